// Forward kinematics, Jacobians and skinning allocate nothing after their first call. The kernels'
// sources are compiled into this test with Eigen's allocation check switched on.
#include <gtest/gtest.h>

#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "mpc/skeleton/skinning_jacobian.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

TEST(NoMalloc, KernelsReuseTheirBuffers) {
  const RigAsset rig = testing::MakeTestRig();
  const Character character = BuildCharacter(rig, MapRigByNames(rig));
  KinematicState state;
  Eigen::MatrixXd joint_jacobian;
  Eigen::Matrix3Xd vertex_jacobian;
  Eigen::Matrix3Xf mesh;
  Eigen::VectorXd pose = character.bind_pose;
  std::vector<DualQuaternion> motions;
  const auto run = [&] {
    ForwardKinematics(character.skeleton, pose, &state);
    JointJacobian(character.skeleton, state, &joint_jacobian);
    SkinCharacter(character, state, &mesh);
    SegmentMotions(character.bind, state, &motions);
    SkinDualQuaternionScalar(character.mesh.positions, character.segments, character.weights,
                             motions, &mesh);
    SkinLinearBlend(character.mesh.positions, character.segments, character.weights, motions,
                    &mesh);
    SkinnedVertex(character, state, 100, &vertex_jacobian);
  };
  run();
  Eigen::internal::set_is_malloc_allowed(false);
  run();
  Eigen::internal::set_is_malloc_allowed(true);
  EXPECT_TRUE(mesh.allFinite());
}

}  // namespace
}  // namespace mpc
