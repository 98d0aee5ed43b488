#include "mpc/io/joint_truth_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "json_file.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "mpc/io/trc.h"
#include "openpose_joint.h"

namespace mpc {
namespace {

using internal::JsonPlace;

constexpr size_t kMaxTruthBytes = size_t{512} << 20;

// Which column of the file holds which joint; a second column of the same joint is left out.
struct Columns {
  std::vector<JointId> joints;
  std::vector<size_t> columns;

  void Add(std::optional<JointId> joint, size_t column) {
    if (!joint || std::find(joints.begin(), joints.end(), *joint) != joints.end()) return;
    joints.push_back(*joint);
    columns.push_back(column);
  }
};

[[noreturn]] void FailWithoutJoints(const std::string& source) {
  throw Error(
      ErrorCode::kBadFile,
      fmt::format("{} has no joint with a known name, such as left_elbow or LElbow", source));
}

JointTrack FromTrc(const std::filesystem::path& path) {
  const MarkerTrajectories markers = ReadTrc(path);
  Columns columns;
  for (size_t m = 0; m < markers.names.size(); ++m) columns.Add(FindJoint(markers.names[m]), m);
  if (columns.joints.empty()) FailWithoutJoints(path.string());
  JointTrack result{columns.joints, markers.fps, {}};
  result.positions.resize(static_cast<Eigen::Index>(3 * columns.joints.size()),
                          markers.positions.cols());
  for (size_t i = 0; i < columns.columns.size(); ++i) {
    result.positions.middleRows<3>(static_cast<Eigen::Index>(3 * i)) =
        markers.positions.middleRows<3>(static_cast<Eigen::Index>(3 * columns.columns[i]));
  }
  return result;
}

Eigen::Vector3d ReadPoint(const JsonPlace& place) {
  place.ExpectSize(3);
  Eigen::Vector3d point = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  for (size_t k = 0; k < 3; ++k) {
    if (!place[k].IsNull()) point[static_cast<Eigen::Index>(k)] = place[k].Number();
  }
  return point;
}

JointTrack FromJson(const std::string& text, const std::string& source) {
  const nlohmann::ordered_json json = internal::ParseJson(text, source);
  const JsonPlace root(json, source);
  JointTrack result;
  result.fps = root["fps"].Number();
  if (result.fps <= 0) root["fps"].Fail("is not a frame rate above 0");
  const JsonPlace names = root["names"];
  Columns columns;
  for (size_t n = 0; n < names.Size(); ++n)
    columns.Add(internal::OpenPoseJoint(names[n].String()), n);
  if (columns.joints.empty()) FailWithoutJoints(source);
  result.joints = columns.joints;

  const JsonPlace frames = root["joints"];
  result.positions.resize(static_cast<Eigen::Index>(3 * columns.joints.size()),
                          static_cast<Eigen::Index>(frames.Size()));
  for (size_t f = 0; f < frames.Size(); ++f) {
    const JsonPlace frame = frames[f];
    frame.ExpectSize(names.Size());
    for (size_t i = 0; i < columns.columns.size(); ++i) {
      result.positions.block<3, 1>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(f)) =
          ReadPoint(frame[columns.columns[i]]);
    }
  }
  return result;
}

}  // namespace

JointTrack ReadJointTrack(const std::filesystem::path& path) {
  const std::string text = ReadFile(path, kMaxTruthBytes);
  const size_t first = text.find_first_not_of(" \t\r\n");
  const bool is_json = first != std::string::npos && text[first] == '{';
  return is_json ? FromJson(text, path.string()) : FromTrc(path);
}

}  // namespace mpc
