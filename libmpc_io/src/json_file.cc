#include "json_file.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "mpc/core/error.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxDepth = 128;

// Writers and destructors of JSON libraries recurse; a file of a million brackets must not.
bool IsTooDeep(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMaxDepth) return true;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

}  // namespace

Json ParseJson(std::string_view text, const std::string& source) {
  if (IsTooDeep(text)) {
    throw Error(ErrorCode::kBadFile,
                fmt::format("{}: JSON nested deeper than {} levels", source, kMaxDepth));
  }
  try {
    return Json::parse(text);
  } catch (const Json::exception& e) {
    throw Error(ErrorCode::kBadFile, fmt::format("{}: not valid JSON: {}", source, e.what()));
  }
}

bool JsonPlace::Has(const std::string& key) const {
  if (!value_->is_object()) return false;
  const auto it = value_->find(key);
  return it != value_->end() && !it->is_null();
}

JsonPlace JsonPlace::operator[](const std::string& key) const {
  if (!value_->is_object()) Fail(fmt::format("is a {}, expected an object", value_->type_name()));
  const auto it = value_->find(key);
  if (it == value_->end()) Fail(fmt::format("has no member \"{}\"", key));
  return {*it, source_, path_.empty() ? key : path_ + "." + key};
}

JsonPlace JsonPlace::operator[](size_t index) const {
  if (index >= Size()) {
    Fail(fmt::format("has {} entries, expected at least {}", Size(), index + 1));
  }
  return {(*value_)[index], source_, fmt::format("{}[{}]", path_, index)};
}

size_t JsonPlace::Size() const {
  if (!value_->is_array()) Fail(fmt::format("is a {}, expected an array", value_->type_name()));
  return value_->size();
}

void JsonPlace::ExpectSize(size_t size) const {
  if (Size() != size) Fail(fmt::format("has {} entries, expected {}", Size(), size));
}

double JsonPlace::Number() const {
  if (!value_->is_number()) Fail(fmt::format("is a {}, expected a number", value_->type_name()));
  const double number = value_->get<double>();
  if (!std::isfinite(number)) Fail("is not a finite number");
  return number;
}

int JsonPlace::Int() const {
  const double number = Number();
  if (number != std::floor(number) || std::abs(number) > std::numeric_limits<int>::max()) {
    Fail(fmt::format("is {}, expected a whole number", number));
  }
  return static_cast<int>(number);
}

std::string JsonPlace::String() const {
  if (!value_->is_string()) Fail(fmt::format("is a {}, expected a text", value_->type_name()));
  return value_->get<std::string>();
}

void JsonPlace::Fail(const std::string& fault) const {
  throw Error(ErrorCode::kBadFile,
              fmt::format("{}: {} {}", source_, path_.empty() ? "the top level" : path_, fault));
}

}  // namespace mpc::internal
