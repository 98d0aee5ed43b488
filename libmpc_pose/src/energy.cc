#include "mpc/pose/energy.h"

#include <algorithm>

namespace mpc {

void PosePoint::Update(const Skeleton& skeleton, bool with_jacobian) {
  ForwardKinematics(skeleton, pose, root_rotation, &state);
  if (with_jacobian) UpdateJacobian(skeleton);
}

void PosePoint::UpdateJacobian(const Skeleton& skeleton) {
  JointJacobian(skeleton, state, &joint_jacobian);
  joint_dofs.resize(skeleton.num_joints());
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    std::vector<int>& dofs = joint_dofs[j];
    dofs.clear();
    for (int s = skeleton.joints[j].segment; s > 0; s = skeleton.segments[s].parent) {
      for (int h = state.hinge_begin[s + 1]; h > state.hinge_begin[s]; --h) dofs.push_back(5 + h);
    }
    for (int n = 5; n >= 0 && !fixed_root; --n) dofs.push_back(n);
    std::reverse(dofs.begin(), dofs.end());
  }
}

}  // namespace mpc
