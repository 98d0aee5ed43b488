#include "mpc/core/detections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "mpc/core/error.h"

namespace mpc {
namespace {

void CheckJoints(const std::vector<JointId>& joints, const char* what) {
  std::array<bool, kNumJointIds> seen{};
  for (const JointId joint : joints) {
    const int id = static_cast<int>(joint);
    if (id < 0 || id >= kNumJointIds) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("{}: joint id {} is not one of 0 to {}", what, id, kNumJointIds - 1));
    }
    if (seen[static_cast<size_t>(id)]) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("{}: joint {} appears twice", what, JointName(joint)));
    }
    seen[static_cast<size_t>(id)] = true;
  }
}

void CheckFrame(const Eigen::Ref<const Eigen::MatrixXd>& points, const Eigen::VectorXd& confidence,
                const std::vector<JointId>& joints, const char* what, size_t frame) {
  const auto num_joints = static_cast<Eigen::Index>(joints.size());
  if (points.cols() != num_joints || confidence.size() != num_joints) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: frame {} has {} positions and {} confidences for {} joints", what,
                            frame, points.cols(), confidence.size(), num_joints));
  }
  for (Eigen::Index j = 0; j < num_joints; ++j) {
    const std::string_view name = JointName(joints[static_cast<size_t>(j)]);
    if (!points.col(j).allFinite()) {
      throw Error(
          ErrorCode::kInvalidArgument,
          fmt::format("{}: frame {}, joint {}: the position is not finite", what, frame, name));
    }
    if (!(confidence[j] >= 0 && confidence[j] <= 1)) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("{}: frame {}, joint {}: confidence {} is not in [0, 1]", what, frame,
                              name, confidence[j]));
    }
  }
}

}  // namespace

void Detections2d::Validate() const {
  constexpr const char* kWhat = "2D detections";
  if (width < 0 || height < 0) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: picture size {} x {} is negative", kWhat, width, height));
  }
  CheckJoints(joints, kWhat);
  for (size_t f = 0; f < frames.size(); ++f) {
    CheckFrame(frames[f].pixels, frames[f].confidence, joints, kWhat, f);
  }
}

void Detections3d::Validate() const {
  constexpr const char* kWhat = "3D detections";
  CheckJoints(joints, kWhat);
  for (size_t f = 0; f < frames.size(); ++f) {
    CheckFrame(frames[f].positions, frames[f].confidence, joints, kWhat, f);
  }
}

int FindColumn(const std::vector<JointId>& joints, JointId joint) {
  const auto it = std::find(joints.begin(), joints.end(), joint);
  return it == joints.end() ? -1 : static_cast<int>(it - joints.begin());
}

}  // namespace mpc
