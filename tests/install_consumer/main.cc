// Moves a skeleton through the public headers; fails when the library does not work as linked.

#include <cmath>
#include <cstdio>

#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skeleton.h"

int main() {
  const mpc::Skeleton skeleton = mpc::DefaultSkeleton();
  Eigen::VectorXd pose = mpc::ZeroPose(skeleton);
  mpc::KinematicState rest, raised;
  mpc::ForwardKinematics(skeleton, pose, &rest);
  pose.y() += 1;
  mpc::ForwardKinematics(skeleton, pose, &raised);
  const double error =
      ((raised.joints - rest.joints).colwise() - Eigen::Vector3d::UnitY()).cwiseAbs().maxCoeff();
  std::printf("%d joints moved by 1 m, error %g m\n", skeleton.num_joints(), error);
  return error < 1e-12 ? 0 : 1;
}
