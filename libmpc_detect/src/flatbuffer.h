// Purpose: a bounds-checked view of a FlatBuffer: tables, vectors, scalars, strings.
// Source: FlatBuffers' binary format ("FlatBuffer Internals"). Little-endian, as the machine is.
//
// Nothing is copied and nothing is trusted: an access outside of the bytes throws Error (kBadFile)
// with the file's name and the byte. Absent fields read as their default, absent vectors as empty.
#pragma once

#include <fmt/format.h>

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "mpc/core/error.h"

namespace mpc::internal {

static_assert(std::endian::native == std::endian::little);

// The file's bytes, and where its faults are reported.
struct FlatBytes {
  std::span<const std::uint8_t> bytes;
  std::string name;

  [[noreturn]] void Fail(std::uint64_t at, std::string_view what) const {
    throw Error(ErrorCode::kBadFile, fmt::format("{}: byte {}: {}", name, at, what));
  }
  void ExpectInside(std::uint64_t at, std::uint64_t size) const {
    if (at > bytes.size() || size > bytes.size() - at) {
      Fail(at, fmt::format("{} bytes wanted, the file has {}", size, bytes.size()));
    }
  }
  template <typename T>
  T Read(std::uint64_t at) const {
    ExpectInside(at, sizeof(T));
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    return value;
  }
  // The place that the unsigned offset at `at` refers to.
  std::uint64_t Follow(std::uint64_t at) const { return at + Read<std::uint32_t>(at); }
};

class FlatTable;

// A vector whose elements, of T or offsets to tables, lie wholly inside the file.
class FlatVector {
 public:
  explicit FlatVector(const FlatBytes* file) : file_(file) {}  // empty
  FlatVector(const FlatBytes* file, std::uint64_t at, std::uint64_t element_size)
      : file_(file), size_(file->Read<std::uint32_t>(at)), at_(at + sizeof(std::uint32_t)) {
    file_->ExpectInside(at_, size_ * element_size);
  }
  std::uint64_t size() const { return size_; }
  std::uint64_t at() const { return at_; }
  template <typename T>
  T Get(std::uint64_t i) const {
    return file_->Read<T>(Place(i, sizeof(T)));
  }
  FlatTable Table(std::uint64_t i) const;

 private:
  std::uint64_t Place(std::uint64_t i, std::uint64_t element_size) const {
    if (i >= size_) file_->Fail(at_, fmt::format("index {} of a vector of {}", i, size_));
    return at_ + i * element_size;
  }
  const FlatBytes* file_;
  std::uint64_t size_ = 0;
  std::uint64_t at_ = 0;
};

class FlatTable {
 public:
  FlatTable(const FlatBytes* file, std::uint64_t at) : file_(file), at_(at) {
    // The offset to the field list is signed and subtracted; out of range wraps to a huge place.
    fields_at_ = at - static_cast<std::uint64_t>(std::int64_t{file->Read<std::int32_t>(at)});
    fields_size_ = file->Read<std::uint16_t>(fields_at_);
    file->ExpectInside(fields_at_, fields_size_);
  }
  [[noreturn]] void Fail(std::string_view what) const { file_->Fail(at_, what); }
  bool Has(int field) const { return Place(field) != 0; }
  template <typename T>
  T Scalar(int field, T absent = {}) const {
    const std::uint64_t place = Place(field);
    return place == 0 ? absent : file_->Read<T>(place);
  }
  FlatTable Table(int field) const {
    const std::uint64_t place = Place(field);
    if (place == 0) Fail(fmt::format("field {} is missing", field));
    return {file_, file_->Follow(place)};
  }
  FlatVector Vector(int field, std::uint64_t element_size) const {
    const std::uint64_t place = Place(field);
    return place == 0 ? FlatVector(file_) : FlatVector(file_, file_->Follow(place), element_size);
  }
  std::string String(int field) const {
    const FlatVector text = Vector(field, 1);
    if (text.size() == 0) return "";
    return {reinterpret_cast<const char*>(file_->bytes.data() + text.at()),
            static_cast<size_t>(text.size())};
  }

 private:
  // Of a field's value; 0 for an absent field.
  std::uint64_t Place(int field) const {
    const std::uint64_t entry = 4 + 2 * static_cast<std::uint64_t>(field);
    if (entry + 2 > fields_size_) return 0;
    const auto offset = file_->Read<std::uint16_t>(fields_at_ + entry);
    return offset == 0 ? 0 : at_ + offset;
  }
  const FlatBytes* file_;
  std::uint64_t at_ = 0;
  std::uint64_t fields_at_ = 0;
  std::uint64_t fields_size_ = 0;
};

inline FlatTable FlatVector::Table(std::uint64_t i) const {
  return {file_, file_->Follow(Place(i, sizeof(std::uint32_t)))};
}

}  // namespace mpc::internal
