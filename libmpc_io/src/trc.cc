#include "mpc/io/trc.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

std::string_view Trimmed(std::string_view text) {
  const char* const kBlanks = " \r\n";
  const size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::vector<std::string_view> SplitAtTabs(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const size_t tab = line.find('\t');
    fields.push_back(Trimmed(line.substr(0, tab)));
    if (tab == std::string_view::npos) return fields;
    line.remove_prefix(tab + 1);
  }
}

// Lines of a text, counted from 1.
class Lines {
 public:
  Lines(std::string text, std::string source)
      : text_(std::move(text)), source_(std::move(source)), rest_(text_) {}

  bool Next(std::string_view* line) {
    if (rest_.empty()) return false;
    ++number_;
    const size_t end = rest_.find('\n');
    *line = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    return true;
  }
  std::string_view Required(const char* what) {
    std::string_view line;
    if (!Next(&line)) Fail(fmt::format("the file ends, expected {}", what));
    return line;
  }
  size_t BytesLeft() const { return rest_.size(); }
  [[noreturn]] void Fail(const std::string& fault) const {
    throw Error(ErrorCode::kBadFile, fmt::format("{}:{}: {}", source_, number_, fault));
  }

 private:
  std::string text_;
  std::string source_;
  std::string_view rest_;
  int number_ = 0;
};

double ParseNumber(const Lines& lines, std::string_view field, const char* what) {
  double value = 0;
  const auto [end, status] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (status != std::errc() || end != field.data() + field.size() || !std::isfinite(value)) {
    lines.Fail(fmt::format("found \"{}\", expected {}", field, what));
  }
  return value;
}

double MetresPerUnit(const Lines& lines, std::string_view unit) {
  if (unit == "m") return 1;
  if (unit == "cm") return 0.01;
  if (unit == "mm") return 0.001;
  lines.Fail(fmt::format("unit \"{}\", expected m, cm or mm", unit));
}

struct TrcHeader {
  double fps = 0;
  double num_frames = 0;
  double num_markers = 0;
  double metres_per_unit = 1;
};

TrcHeader ReadHeader(Lines& lines) {
  if (lines.Required("PathFileType").substr(0, 12) != "PathFileType") {
    lines.Fail("found no PathFileType: this is not a TRC file");
  }
  const std::vector<std::string_view> keys = SplitAtTabs(lines.Required("the header's names"));
  const std::vector<std::string_view> values = SplitAtTabs(lines.Required("the header's values"));
  const auto value = [&](std::string_view key) {
    for (size_t i = 0; i < std::min(keys.size(), values.size()); ++i) {
      if (keys[i] == key) return values[i];
    }
    lines.Fail(fmt::format("the header has no {}", key));
  };
  TrcHeader header;
  header.fps = ParseNumber(lines, value("DataRate"), "a data rate");
  header.num_frames = ParseNumber(lines, value("NumFrames"), "a number of frames");
  header.num_markers = ParseNumber(lines, value("NumMarkers"), "a number of markers");
  header.metres_per_unit = MetresPerUnit(lines, value("Units"));
  if (header.fps <= 0) lines.Fail(fmt::format("data rate {}, expected more than 0", header.fps));
  return header;
}

}  // namespace

MarkerTrajectories ReadTrc(const std::filesystem::path& path) {
  Lines lines(ReadFile(path), path.string());
  const TrcHeader header = ReadHeader(lines);
  MarkerTrajectories trajectories;
  trajectories.fps = header.fps;
  const std::vector<std::string_view> columns = SplitAtTabs(lines.Required("the markers' names"));
  for (size_t i = 2; i < columns.size(); i += 3) {
    if (!columns[i].empty()) trajectories.names.emplace_back(columns[i]);
  }
  const size_t num_markers = trajectories.names.size();
  if (num_markers == 0 || static_cast<double>(num_markers) != header.num_markers) {
    lines.Fail(fmt::format("{} marker names, the header says {}", num_markers, header.num_markers));
  }
  lines.Required("the coordinates' names");

  std::vector<double> values;  // frame after frame
  double num_frames = 0;
  for (std::string_view line; lines.Next(&line);) {
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    const std::vector<std::string_view> fields = SplitAtTabs(line);
    const size_t num_columns = 3 * num_markers + 2;
    if (fields.size() < num_columns) {
      lines.Fail(fmt::format("{} columns, expected {}", fields.size(), num_columns));
    }
    for (size_t i = num_columns; i < fields.size(); ++i) {
      if (!fields[i].empty()) lines.Fail(fmt::format("more than {} columns", num_columns));
    }
    for (size_t i = 2; i < num_columns; ++i) {
      const bool missing = fields[i].empty() || fields[i] == "NaN" || fields[i] == "nan";
      values.push_back(missing ? kMissing
                               : header.metres_per_unit *
                                     ParseNumber(lines, fields[i], "a coordinate"));
    }
    ++num_frames;
  }
  if (num_frames != header.num_frames) {
    lines.Fail(fmt::format("{} frames, the header says {}", num_frames, header.num_frames));
  }
  trajectories.positions = Eigen::Map<const Eigen::MatrixXd>(
      values.data(), static_cast<int>(3 * num_markers), static_cast<int>(num_frames));
  return trajectories;
}

void WriteTrc(const std::filesystem::path& path, const MarkerTrajectories& trajectories) {
  const auto fail = [&](const std::string& fault) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("{}: {}", path.string(), fault));
  };
  const long num_markers = static_cast<long>(trajectories.names.size());
  const int num_frames = trajectories.num_frames();
  if (num_markers == 0 || trajectories.positions.rows() != 3 * num_markers) {
    fail(fmt::format("{} rows of positions for {} markers", trajectories.positions.rows(),
                     num_markers));
  }
  if (!(trajectories.fps > 0) || !std::isfinite(trajectories.fps)) {
    fail(fmt::format("{} frames per second", trajectories.fps));
  }
  std::string text = fmt::format("PathFileType\t4\t(X/Y/Z)\t{}\n", path.filename().string());
  text +=
      "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
      "OrigNumFrames\n";
  text += fmt::format("{0}\t{0}\t{1}\t{2}\tm\t{0}\t1\t{1}\n", trajectories.fps, num_frames,
                      num_markers);
  text += "Frame#\tTime";
  std::string axes = "\t";
  for (long m = 0; m < num_markers; ++m) {
    const std::string& name = trajectories.names[static_cast<size_t>(m)];
    if (name.empty() || name.find_first_of("\t\r\n") != std::string::npos) {
      fail(fmt::format("marker name \"{}\" is empty or holds a tab or line end", name));
    }
    text += (m ? "\t\t\t" : "\t") + name;
    axes += fmt::format("\tX{0}\tY{0}\tZ{0}", m + 1);
  }
  text += "\t\t\n" + axes + "\n\n";
  for (int f = 0; f < num_frames; ++f) {
    text += fmt::format("{}\t{:.6f}", f + 1, f / trajectories.fps);
    for (long m = 0; m < num_markers; ++m) {
      const Eigen::Vector3d position = trajectories.positions.col(f).segment<3>(3 * m);
      text += position.allFinite() ? fmt::format("\t{:.6f}\t{:.6f}\t{:.6f}", position.x(),
                                                 position.y(), position.z())
                                   : "\t\t\t";
    }
    text += "\n";
  }
  WriteFileAtomically(path, text);
}

}  // namespace mpc
