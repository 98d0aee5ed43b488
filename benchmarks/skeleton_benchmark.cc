// Speed of mpc::skeleton beside plain baselines; names as in README.md.

#include <benchmark/benchmark.h>
#include <ceres/jet.h>

#include <Eigen/Geometry>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "mpc/skeleton/skinning_jacobian.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

// A mesh of the size of a scanned actor: as many vertices have one, two, three and four influences.
struct Cloud {
  static constexpr int kVertices = 14000;
  static constexpr int kInfluences = 4;

  Cloud() {
    std::mt19937 rng(1);
    std::uniform_real_distribution<float> uniform(0, 1);
    std::uniform_int_distribution<int> segment(0, kNumDefaultSegments - 1);
    for (int v = 0; v < kVertices; ++v) {
      for (int i = 0; i < 3; ++i) positions(i, v) = uniform(rng);
      for (int k = 0; k < kInfluences; ++k) {
        segments(k, v) = segment(rng);
        weights(k, v) = k <= v % kInfluences ? 0.1f + uniform(rng) : 0;
      }
      weights.col(v) /= weights.col(v).sum();
    }
    std::normal_distribution<double> normal(0, 0.3);
    const Skeleton skeleton = DefaultSkeleton();
    Eigen::VectorXd pose(skeleton.num_dofs());
    for (double& x : pose) x = normal(rng);
    KinematicState bind, state;
    ForwardKinematics(skeleton, ZeroPose(skeleton), &bind);
    ForwardKinematics(skeleton, pose, &state);
    SegmentMotions(bind, state, &motions);
  }

  Eigen::Matrix3Xf positions{3, kVertices};
  Eigen::MatrixXi segments{kInfluences, kVertices};
  Eigen::MatrixXf weights{kInfluences, kVertices};
  std::vector<DualQuaternion> motions;
  Eigen::Matrix3Xf out{3, kVertices};
};

void SkinDualQuaternion_14kVertices(benchmark::State& state) {
  Cloud cloud;
  for (auto _ : state) {
    SkinDualQuaternion(cloud.positions, cloud.segments, cloud.weights, cloud.motions, &cloud.out);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * Cloud::kVertices);
}
BENCHMARK(SkinDualQuaternion_14kVertices)->Unit(benchmark::kMicrosecond);

void SkinDualQuaternion_14kVertices_ScalarTwin(benchmark::State& state) {
  Cloud cloud;
  for (auto _ : state) {
    SkinDualQuaternionScalar(cloud.positions, cloud.segments, cloud.weights, cloud.motions,
                             &cloud.out);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * Cloud::kVertices);
}
BENCHMARK(SkinDualQuaternion_14kVertices_ScalarTwin)->Unit(benchmark::kMicrosecond);

// The textbook in Eigen: blend, normalise, rotate and translate.
void SkinDualQuaternion_14kVertices_BaselineEigen(benchmark::State& state) {
  Cloud cloud;
  for (auto _ : state) {
    for (int v = 0; v < Cloud::kVertices; ++v) {
      const Eigen::Vector4f pivot = cloud.motions[cloud.segments(0, v)].real;
      Eigen::Vector4f real = Eigen::Vector4f::Zero();
      Eigen::Vector4f dual = Eigen::Vector4f::Zero();
      for (int k = 0; k < Cloud::kInfluences; ++k) {
        const DualQuaternion& motion = cloud.motions[cloud.segments(k, v)];
        float weight = cloud.weights(k, v);
        if (motion.real.dot(pivot) < 0) weight = -weight;
        real += weight * motion.real;
        dual += weight * motion.dual;
      }
      const float norm = real.norm();
      real /= norm;
      dual /= norm;
      const Eigen::Vector3f x = cloud.positions.col(v);
      const Eigen::Vector3f r = real.tail<3>();
      const Eigen::Vector3f d = dual.tail<3>();
      cloud.out.col(v) =
          x + 2 * r.cross(r.cross(x) + real[0] * x) + 2 * (real[0] * d - dual[0] * r + r.cross(d));
    }
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * Cloud::kVertices);
}
BENCHMARK(SkinDualQuaternion_14kVertices_BaselineEigen)->Unit(benchmark::kMicrosecond);

void ForwardKinematicsAndJointJacobian(benchmark::State& state) {
  const Skeleton skeleton = DefaultSkeleton();
  const Eigen::VectorXd pose = Eigen::VectorXd::LinSpaced(skeleton.num_dofs(), -0.5, 0.7);
  KinematicState kinematics;
  Eigen::MatrixXd jacobian;
  for (auto _ : state) {
    ForwardKinematics(skeleton, pose, &kinematics);
    JointJacobian(skeleton, kinematics, &jacobian);
    benchmark::DoNotOptimize(jacobian.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(ForwardKinematicsAndJointJacobian)->Unit(benchmark::kMicrosecond);

// Forward kinematics on jets, derivatives of all dofs at once.
void ForwardKinematicsAndJointJacobian_BaselineAutoDiff(benchmark::State& state) {
  constexpr int kDofs = 33;
  using Jet = ceres::Jet<double, kDofs>;
  using Matrix3 = Eigen::Matrix<Jet, 3, 3>;
  using Vector3 = Eigen::Matrix<Jet, 3, 1>;
  const Skeleton skeleton = DefaultSkeleton();
  const Eigen::VectorXd pose = Eigen::VectorXd::LinSpaced(skeleton.num_dofs(), -0.5, 0.7);
  const Eigen::Matrix3d start = ExpSO3(pose.segment<3>(3));
  std::vector<Matrix3> rotations(skeleton.num_segments());
  std::vector<Vector3> origins(skeleton.num_segments());
  std::vector<Vector3> joints(skeleton.num_joints());
  for (auto _ : state) {
    Eigen::Matrix<Jet, kDofs, 1> x;
    for (int n = 0; n < kDofs; ++n) x[n] = Jet(n >= 3 && n < 6 ? 0 : pose[n], n);
    Matrix3 tangent = Matrix3::Identity();
    tangent(0, 1) = -x[5], tangent(1, 0) = x[5];
    tangent(0, 2) = x[4], tangent(2, 0) = -x[4];
    tangent(1, 2) = -x[3], tangent(2, 1) = x[3];
    rotations[0] = tangent * start.cast<Jet>();
    origins[0] = x.head<3>();
    size_t h = 0;
    for (int s = 1; s < skeleton.num_segments(); ++s) {
      const Segment& segment = skeleton.segments[s];
      origins[s] = origins[segment.parent] + rotations[segment.parent] * segment.offset.cast<Jet>();
      rotations[s] = rotations[segment.parent] * segment.rest_rotation.cast<Jet>();
      for (; h < skeleton.hinges.size() && skeleton.hinges[h].segment == s; ++h) {
        const Eigen::Vector3d& axis = skeleton.hinges[h].axis;
        Eigen::Matrix3d cross;
        cross << 0, -axis.z(), axis.y(), axis.z(), 0, -axis.x(), -axis.y(), axis.x(), 0;
        const Eigen::Matrix3d cross_twice = cross * cross;
        const Matrix3 turn = Matrix3::Identity() + sin(x[6 + h]) * cross.cast<Jet>() +
                             (Jet(1) - cos(x[6 + h])) * cross_twice.cast<Jet>();
        rotations[s] = (rotations[s] * turn).eval();
      }
    }
    for (int j = 0; j < skeleton.num_joints(); ++j) {
      const SkeletonJoint& joint = skeleton.joints[j];
      joints[j] =
          origins[joint.segment] + rotations[joint.segment] * joint.x_in_segment.cast<Jet>();
    }
    benchmark::DoNotOptimize(joints.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(ForwardKinematicsAndJointJacobian_BaselineAutoDiff)->Unit(benchmark::kMicrosecond);

void SkinnedVertexWithJacobian(benchmark::State& state) {
  const RigAsset rig = testing::MakeTestRig();
  const Character character = BuildCharacter(rig, MapRigByNames(rig));
  Eigen::Matrix3Xd jacobian;
  int vertex = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(SkinnedVertex(character, character.bind, vertex, &jacobian));
    benchmark::DoNotOptimize(jacobian.data());
    vertex = (vertex + 1) % static_cast<int>(character.mesh.positions.cols());
  }
}
BENCHMARK(SkinnedVertexWithJacobian);

}  // namespace
}  // namespace mpc
