#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "bvh_channels.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/bvh.h"

namespace mpc {
namespace {

constexpr size_t kMaxJoints = 10000;

bool EqualIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return tolower(x) == tolower(y); });
}

// Words of a text with their line numbers.
class Scanner {
 public:
  Scanner(std::string text, std::string source)
      : text_(std::move(text)), source_(std::move(source)) {}

  std::string_view Next() {
    SkipBlanks();
    const size_t begin = at_;
    while (at_ < text_.size() && !IsBlank(text_[at_])) ++at_;
    if (at_ == begin) Fail("the file ends here");
    return std::string_view(text_).substr(begin, at_ - begin);
  }

  // The rest of the current line without blanks at its ends: a name may hold spaces.
  std::string RestOfLine() {
    size_t end = text_.find_first_of("\r\n", at_);
    if (end == std::string::npos) end = text_.size();
    std::string_view rest = std::string_view(text_).substr(at_, end - at_);
    at_ = end;
    while (!rest.empty() && IsBlank(rest.front())) rest.remove_prefix(1);
    while (!rest.empty() && IsBlank(rest.back())) rest.remove_suffix(1);
    return std::string(rest);
  }

  void Expect(std::string_view word) {
    const std::string_view found = Next();
    if (!EqualIgnoringCase(found, word))
      Fail(fmt::format("found \"{}\", expected {}", found, word));
  }

  double Number() {
    std::string_view word = Next();
    if (word.size() > 1 && word.front() == '+') word.remove_prefix(1);
    double value = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (status != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) {
      Fail(fmt::format("found \"{}\", expected a finite number", word));
    }
    return value;
  }

  long Count(long max, const char* what) {
    const std::string_view word = Next();
    long value = 0;
    const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (status != std::errc() || end != word.data() + word.size() || value < 0 || value > max) {
      Fail(fmt::format("found \"{}\", expected the number of {} (0 to {})", word, what, max));
    }
    return value;
  }

  size_t BytesLeft() const { return text_.size() - at_; }

  [[noreturn]] void Fail(const std::string& fault) const {
    throw Error(ErrorCode::kBadFile, fmt::format("{}:{}: {}", source_, line_, fault));
  }

 private:
  static bool IsBlank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v' || c == '\0';
  }
  void SkipBlanks() {
    for (; at_ < text_.size() && IsBlank(text_[at_]); ++at_) line_ += text_[at_] == '\n';
  }

  std::string text_;
  std::string source_;
  size_t at_ = 0;
  int line_ = 1;
};

Eigen::Vector3d ReadOffset(Scanner& scanner) {
  const double x = scanner.Number();
  const double y = scanner.Number();
  const double z = scanner.Number();
  return {x, y, z};
}

std::vector<BvhChannel> ReadChannels(Scanner& scanner) {
  std::vector<BvhChannel> channels;
  const long count = scanner.Count(6, "channels");
  for (long i = 0; i < count; ++i) {
    const std::string_view word = scanner.Next();
    size_t k = 0;
    while (k < kChannelNames.size() && !EqualIgnoringCase(word, kChannelNames[k])) ++k;
    if (k == kChannelNames.size()) {
      scanner.Fail(fmt::format("found \"{}\", expected a channel such as Xrotation", word));
    }
    const auto channel = static_cast<BvhChannel>(k);
    if (std::find(channels.begin(), channels.end(), channel) != channels.end()) {
      scanner.Fail(fmt::format("channel {} given twice", word));
    }
    channels.push_back(channel);
  }
  return channels;
}

// Reads the joints up to and including the word MOTION.
std::vector<BvhJoint> ReadHierarchy(Scanner& scanner) {
  scanner.Expect("HIERARCHY");
  std::vector<BvhJoint> joints;
  std::vector<int> open;  // joints whose brace is open
  for (;;) {
    const std::string_view word = scanner.Next();
    if (EqualIgnoringCase(word, "ROOT") || EqualIgnoringCase(word, "JOINT")) {
      const bool is_root = EqualIgnoringCase(word, "ROOT");
      if (is_root != open.empty()) {
        scanner.Fail(is_root ? "ROOT inside a joint" : "JOINT outside of a ROOT");
      }
      if (joints.size() == kMaxJoints) scanner.Fail(fmt::format("more than {} joints", kMaxJoints));
      BvhJoint joint;
      joint.name = scanner.RestOfLine();
      if (!joint.name.empty() && joint.name.back() == '{') {
        scanner.Fail("found \"{\" in a joint's name, expected it on the next line");
      }
      joint.parent = open.empty() ? -1 : open.back();
      scanner.Expect("{");
      scanner.Expect("OFFSET");
      joint.offset = ReadOffset(scanner);
      scanner.Expect("CHANNELS");
      joint.channels = ReadChannels(scanner);
      open.push_back(static_cast<int>(joints.size()));
      joints.push_back(std::move(joint));
    } else if (EqualIgnoringCase(word, "End")) {
      if (open.empty()) scanner.Fail("End Site outside of a joint");
      scanner.RestOfLine();
      scanner.Expect("{");
      scanner.Expect("OFFSET");
      joints[static_cast<size_t>(open.back())].end_site = ReadOffset(scanner);
      scanner.Expect("}");
    } else if (word == "}") {
      if (open.empty()) scanner.Fail("found \"}\" without its \"{\"");
      open.pop_back();
    } else if (EqualIgnoringCase(word, "MOTION")) {
      if (!open.empty()) scanner.Fail("found MOTION inside a joint, expected \"}\"");
      if (joints.empty()) scanner.Fail("the hierarchy has no joint");
      return joints;
    } else {
      scanner.Fail(fmt::format("found \"{}\", expected ROOT, JOINT, End Site, }} or MOTION", word));
    }
  }
}

}  // namespace

BvhMotion ReadBvh(const std::filesystem::path& path) {
  Scanner scanner(ReadFile(path), path.string());
  BvhMotion motion;
  motion.joints = ReadHierarchy(scanner);
  size_t num_channels = 0;
  for (const BvhJoint& joint : motion.joints) num_channels += joint.channels.size();
  if (num_channels == 0) scanner.Fail("no joint has a channel");

  scanner.Expect("Frames:");
  const long num_frames = scanner.Count(100000000, "frames");
  scanner.Expect("Frame");
  scanner.Expect("Time:");
  motion.frame_time_s = scanner.Number();
  if (motion.frame_time_s <= 0) {
    scanner.Fail(fmt::format("frame time {} s, expected more than 0", motion.frame_time_s));
  }
  // Every value takes two bytes at least: this bounds what a false count can allocate.
  if (static_cast<size_t>(num_frames) > scanner.BytesLeft() / (2 * num_channels) + 1) {
    scanner.Fail(fmt::format("{} frames of {} channels do not fit into the {} bytes that follow",
                             num_frames, num_channels, scanner.BytesLeft()));
  }
  motion.values.resize(static_cast<int>(num_channels), num_frames);
  for (double& value : motion.values.reshaped()) value = scanner.Number();
  return motion;
}

}  // namespace mpc
