// Purpose: JSON with the project's errors: every fault names the file and the place in it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace mpc::internal {

// Parses text; `source` (a file name) goes into messages. Throws Error (kBadFile) for a syntax
// error and for nesting deeper than any sane file.
nlohmann::ordered_json ParseJson(std::string_view text, const std::string& source);

// A value inside a parsed file together with its path, such as "frames[3].det".
class JsonPlace {
 public:
  JsonPlace(const nlohmann::ordered_json& value, std::string source, std::string path = "")
      : value_(&value), source_(std::move(source)), path_(std::move(path)) {}

  bool Has(const std::string& key) const;              // an object with a non-null member `key`
  JsonPlace operator[](const std::string& key) const;  // throws when it is missing
  JsonPlace operator[](size_t index) const;            // throws when out of range
  size_t Size() const;                                 // of an array; throws for another kind
  void ExpectSize(size_t size) const;

  bool IsNull() const { return value_->is_null(); }
  bool IsObject() const { return value_->is_object(); }
  bool IsArray() const { return value_->is_array(); }
  double Number() const;  // finite
  int Int() const;
  std::string String() const;

  // Throws Error (kBadFile): "<source>: <path> <fault>".
  [[noreturn]] void Fail(const std::string& fault) const;

 private:
  const nlohmann::ordered_json* value_;
  std::string source_;
  std::string path_;
};

}  // namespace mpc::internal
