#include "mpc/eval/stool.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mpc/core/error.h"
#include "mpc/eval/motions.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {

Stool StoolUnder(const DressedActor& actor, const Character& character,
                 const Eigen::VectorXd& first_pose) {
  constexpr double kSinkM = 0.01;
  constexpr double kLeastM = 0.1;
  // Long enough to reach the seat.
  const Eigen::MatrixXd poses = MakeMotion(character.skeleton, MotionKind::kSit, 2, 30);
  Eigen::VectorXd seated = poses.rightCols<1>();
  seated.head<3>() += first_pose.head<3>() - poses.col(0).head<3>();
  KinematicState state;
  ForwardKinematics(character.skeleton, seated, &state);
  Eigen::Matrix3Xf vertices;
  SkinCharacter(character, state, &vertices);

  Stool stool;
  const auto joint = [&](JointId id) {
    return Eigen::Vector3d(state.joints.col(character.skeleton.FindJointIndex(id)));
  };
  const Eigen::Vector3d hips = 0.5 * (joint(JointId::kLeftHip) + joint(JointId::kRightHip));
  const Eigen::Vector3d knees = 0.5 * (joint(JointId::kLeftKnee) + joint(JointId::kRightKnee));
  stool.top = hips + 0.15 * (knees - hips);  // the thighs lie on it too
  stool.top.y() = std::numeric_limits<double>::infinity();
  const ClothModel& cloth = actor.cloth;
  for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
    const int particle = cloth.particle.empty() ? -1 : cloth.particle[v];
    if (particle >= 0 && std::isinf(cloth.freedom_m[particle])) continue;
    const Eigen::Vector3d x = vertices.col(v).cast<double>();
    const double away = std::max(std::abs(x.x() - stool.top.x()), std::abs(x.z() - stool.top.z()));
    if (away < 0.5 * stool.side_m) stool.top.y() = std::min(stool.top.y(), x.y());
  }
  stool.top.y() += kSinkM;
  if (!(stool.top.y() >= kLeastM && std::isfinite(stool.top.y()))) {
    throw Error(ErrorCode::kUnsupported, "there is no room for a stool under the body");
  }
  return stool;
}

}  // namespace mpc
