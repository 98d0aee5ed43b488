#include "mpc/io/video_lens.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <span>
#include <string_view>
#include <vector>

namespace mpc {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::string_view kKey = "com.apple.quicktime.camera.focal_length.35mm_equivalent";
constexpr std::uint64_t kMaxIndexBytes = 256 << 20;
constexpr int kMaxTopBoxes = 1000;  // before the index
constexpr double kMinFocal35mm = 4;
constexpr double kMaxFocal35mm = 1000;
constexpr double kPhotoLongerSideMm = 43.267 * 4 / 5;  // of 4:3 with the diagonal of 36 x 24

// Of at most 8 bytes.
std::uint64_t BigEndian(Bytes bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

constexpr std::uint32_t Type(const char (&name)[5]) {
  std::uint32_t type = 0;
  for (int i = 0; i < 4; ++i) type = type << 8 | static_cast<std::uint8_t>(name[i]);
  return type;
}

// Calls visit(type, content) for each of the boxes in a row, as far as they are whole.
template <typename Visit>
void ForEachBox(Bytes bytes, const Visit& visit) {
  while (bytes.size() >= 8) {
    const auto type = static_cast<std::uint32_t>(BigEndian(bytes.subspan(4, 4)));
    std::uint64_t size = BigEndian(bytes.first(4));
    std::size_t header = 8;
    if (size == 1 && bytes.size() >= 16) {
      size = BigEndian(bytes.subspan(8, 8));
      header = 16;
    }
    if (size == 0) size = bytes.size();
    if (size < header || size > bytes.size()) return;
    visit(type, bytes.subspan(header, size - header));
    bytes = bytes.subspan(size);
  }
}

// The number in a "data" box: its kind, language, value. QuickTime's well-known kinds of values.
std::optional<double> Number(Bytes data) {
  if (data.size() < 9) return std::nullopt;
  const std::uint64_t kind = BigEndian(data.first(4));
  const Bytes value = data.subspan(8);
  if (kind == 1) {  // UTF-8, perhaps with a unit
    const auto* const text = reinterpret_cast<const char*>(value.data());
    double number = 0;
    const auto [end, ec] = std::from_chars(text, text + value.size(), number);
    return ec == std::errc() ? std::optional(number) : std::nullopt;
  }
  if (value.size() > 8) return std::nullopt;
  const std::uint64_t bits = BigEndian(value);
  switch (kind) {
    case 23:
      if (value.size() != 4) return std::nullopt;
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    case 24:
      if (value.size() != 8) return std::nullopt;
      return std::bit_cast<double>(bits);
    case 21:  // integers with a sign
    case 65:
    case 66:
    case 67:
    case 74: {
      const auto unused = static_cast<int>(64 - 8 * value.size());
      return static_cast<double>(static_cast<std::int64_t>(bits << unused) >> unused);
    }
    case 22:  // and without
    case 75:
    case 76:
    case 77:
    case 78:
      return static_cast<double>(bits);
    default:
      return std::nullopt;
  }
}

// "keys" lists names, "ilst" has values under their numbers, from 1 on.
std::optional<double> FocalOfMeta(Bytes meta) {
  // QuickTime's box starts with a box, that of MP4 with a version.
  if (meta.size() >= 8 && BigEndian(meta.subspan(4, 4)) != Type("hdlr")) meta = meta.subspan(4);
  std::uint32_t number = 0;
  std::optional<double> focal;
  ForEachBox(meta, [&](std::uint32_t type, Bytes content) {
    if (type == Type("keys") && content.size() >= 8) {
      std::uint32_t i = 0;
      ForEachBox(content.subspan(8), [&](std::uint32_t, Bytes name) {
        ++i;
        if (std::equal(name.begin(), name.end(), kKey.begin(), kKey.end())) number = i;
      });
    }
    if (type != Type("ilst") || number == 0) return;
    ForEachBox(content, [&](std::uint32_t item, Bytes data) {
      if (item != number) return;
      ForEachBox(data, [&](std::uint32_t data_type, Bytes value) {
        if (data_type == Type("data") && !focal) focal = Number(value);
      });
    });
  });
  if (focal && !(*focal >= kMinFocal35mm && *focal <= kMaxFocal35mm)) focal.reset();
  return focal;
}

// In the index of a file and in those of its tracks; `depth` boxes below the index.
std::optional<double> FocalOfIndex(Bytes index, int depth) {
  std::optional<double> focal;
  ForEachBox(index, [&](std::uint32_t type, Bytes content) {
    if (focal) return;
    if (type == Type("meta")) focal = FocalOfMeta(content);
    const bool holds_meta = type == Type("trak") || type == Type("udta");
    if (holds_meta && depth < 2) focal = FocalOfIndex(content, depth + 1);
  });
  return focal;
}

// The content of "moov"; empty when there is none.
std::vector<std::uint8_t> ReadIndex(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code ec;
  const std::uint64_t file_size = std::filesystem::file_size(path, ec);
  if (ec || !file) return {};
  std::uint64_t at = 0;
  for (int i = 0; i < kMaxTopBoxes && file_size - at >= 8; ++i) {
    std::uint8_t head[16] = {};
    file.seekg(static_cast<std::streamoff>(at));
    file.read(reinterpret_cast<char*>(head),
              static_cast<std::streamsize>(std::min<std::uint64_t>(sizeof(head), file_size - at)));
    if (file.bad()) return {};
    std::uint64_t size = BigEndian(Bytes(head, 4));
    if (size == 1) size = BigEndian(Bytes(head + 8, 8));
    if (size == 0) size = file_size - at;
    if (size < 8 || size > file_size - at) return {};
    if (BigEndian(Bytes(head + 4, 4)) == Type("moov")) {
      if (size > kMaxIndexBytes) return {};
      std::vector<std::uint8_t> box(size);
      file.seekg(static_cast<std::streamoff>(at));
      file.read(reinterpret_cast<char*>(box.data()), static_cast<std::streamsize>(size));
      if (!file) return {};
      return box;
    }
    at += size;
  }
  return {};
}

}  // namespace

std::optional<double> ReadFocalLength35mm(const std::filesystem::path& video) {
  const std::vector<std::uint8_t> box = ReadIndex(video);
  std::optional<double> focal;
  ForEachBox(box, [&](std::uint32_t, Bytes index) { focal = FocalOfIndex(index, 0); });
  return focal;
}

double FocalPxFrom35mm(double focal_35mm, int width, int height) {
  return focal_35mm * std::max(width, height) / kPhotoLongerSideMm;
}

}  // namespace mpc
