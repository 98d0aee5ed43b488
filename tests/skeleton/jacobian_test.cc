// Analytic Jacobians of joints and skinned vertices against automatic differentiation and central
// differences.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "mpc/skeleton/skinning_jacobian.h"
#include "support/check_jacobian.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kDofs = 33;
using Jet = ceres::Jet<double, kDofs>;

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;

// Rotation from quaternion (w, v) and back, written out so that it works for jets.
template <typename T>
Matrix3<T> RotationOf(const Eigen::Quaternion<T>& q) {
  Matrix3<T> cross;
  cross << T(0), -q.z(), q.y(), q.z(), T(0), -q.x(), -q.y(), q.x(), T(0);
  return Matrix3<T>::Identity() + T(2) * q.w() * cross + T(2) * cross * cross;
}

template <typename T>
struct TwinState {
  std::vector<Eigen::Quaternion<T>> rotations;
  std::vector<Vector3<T>> origins;
};

// Forward kinematics by quaternions. Root rotation: exp(tangent) * start, as the analytic columns.
template <typename T>
TwinState<T> TwinKinematics(const Skeleton& skeleton, const VectorXd& pose,
                            const Eigen::Matrix<T, kDofs, 1>& dofs) {
  TwinState<T> state;
  const Vector3<T> half = dofs.template segment<3>(3) / T(2);
  // Exact to first order at zero, which is where it is evaluated.
  Eigen::Quaternion<T> root(T(1), half.x(), half.y(), half.z());
  const Eigen::Quaterniond start(ExpSO3(pose.segment<3>(3)));
  root = root * start.cast<T>();
  size_t h = 0;
  for (int s = 0; s < skeleton.num_segments(); ++s) {
    const Segment& segment = skeleton.segments[s];
    if (s == 0) {
      state.rotations.push_back(root);
      state.origins.push_back(dofs.template head<3>());
      continue;
    }
    const Eigen::Quaternion<T>& parent = state.rotations[segment.parent];
    state.origins.push_back(state.origins[segment.parent] +
                            RotationOf(parent) * segment.offset.cast<T>());
    Eigen::Quaternion<T> rotation = parent * Eigen::Quaterniond(segment.rest_rotation).cast<T>();
    for (; h < skeleton.hinges.size() && skeleton.hinges[h].segment == s; ++h) {
      const T angle = dofs[6 + h] / T(2);
      const Vector3<T> axis = skeleton.hinges[h].axis.cast<T>() * sin(angle);
      rotation = rotation * Eigen::Quaternion<T>(cos(angle), axis.x(), axis.y(), axis.z());
    }
    state.rotations.push_back(rotation);
  }
  return state;
}

// Textbook dual-quaternion skinning: blend, normalise, transform.
template <typename T>
Vector3<T> TwinVertex(const Character& character, const TwinState<T>& state, int vertex) {
  Eigen::Matrix<T, 4, 1> real = Eigen::Matrix<T, 4, 1>::Zero();
  Eigen::Matrix<T, 4, 1> dual = Eigen::Matrix<T, 4, 1>::Zero();
  Eigen::Matrix<T, 4, 1> pivot;
  for (Eigen::Index k = 0; k < character.segments.rows(); ++k) {
    const int s = character.segments(k, vertex);
    const Eigen::Quaternion<T> q =
        state.rotations[s] * Eigen::Quaterniond(character.bind.rotations[s]).conjugate().cast<T>();
    const Vector3<T> t =
        (state.origins[s] -
         RotationOf(q) * Eigen::Vector3d(character.bind.origins.col(s)).cast<T>()) /
        T(2);
    const Eigen::Quaternion<T> e = Eigen::Quaternion<T>(T(0), t.x(), t.y(), t.z()) * q;
    if (k == 0) pivot = q.coeffs();
    const T weight = T(character.weights(k, vertex)) * T(pivot.dot(q.coeffs()) < T(0) ? -1 : 1);
    real += weight * q.coeffs();
    dual += weight * e.coeffs();
  }
  const T norm = sqrt(real.squaredNorm());
  real /= norm;
  dual /= norm;
  const Eigen::Quaternion<T> rotation(real[3], real[0], real[1], real[2]);
  const Eigen::Quaternion<T> translation =
      Eigen::Quaternion<T>(dual[3], dual[0], dual[1], dual[2]) * rotation.conjugate();
  const Vector3<T> x = character.mesh.positions.col(vertex).cast<double>().cast<T>();
  return RotationOf(rotation) * x + T(2) * translation.vec();
}

class Jacobians : public ::testing::Test {
 protected:
  VectorXd RandomPose() {
    VectorXd pose(kDofs);
    std::normal_distribution<double> normal(0, 0.8);
    for (double& x : pose) x = normal(rng_);
    return pose;
  }
  // Values at the pose, derivatives along the tangent of the analytic columns.
  static Eigen::Matrix<Jet, kDofs, 1> Jets(const VectorXd& pose) {
    Eigen::Matrix<Jet, kDofs, 1> jets;
    for (int n = 0; n < kDofs; ++n) jets[n] = Jet(n >= 3 && n < 6 ? 0.0 : pose[n], n);
    return jets;
  }
  static VectorXd Plus(const VectorXd& pose, const VectorXd& d) {
    VectorXd moved = pose + d;
    moved.segment<3>(3) = LogSO3(ExpSO3(d.segment<3>(3)) * ExpSO3(pose.segment<3>(3)));
    return moved;
  }

  std::mt19937 rng_{17};
  RigAsset rig_ = testing::MakeTestRig({.arm_down_rad = 0.7, .elbow_bend_rad = 0.4});
  Character character_ = BuildCharacter(rig_, MapRigByNames(rig_));
};

TEST_F(Jacobians, JointsEqualAutomaticDifferentiation) {
  const Skeleton& skeleton = character_.skeleton;
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd pose = RandomPose();
    KinematicState state;
    ForwardKinematics(skeleton, pose, &state);
    MatrixXd jacobian;
    JointJacobian(skeleton, state, &jacobian);
    ASSERT_EQ(jacobian.rows(), 3 * skeleton.num_joints());
    ASSERT_EQ(jacobian.cols(), kDofs);
    const TwinState<Jet> twin = TwinKinematics(skeleton, pose, Jets(pose));
    for (int j = 0; j < skeleton.num_joints(); ++j) {
      const SkeletonJoint& joint = skeleton.joints[j];
      const Vector3<Jet> x =
          twin.origins[joint.segment] +
          RotationOf(twin.rotations[joint.segment]) * joint.x_in_segment.cast<Jet>();
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(x[i].a, state.joints(i, j), 1e-12);
        EXPECT_LT((x[i].v.transpose() - jacobian.row(3 * j + i)).cwiseAbs().maxCoeff(), 1e-10);
      }
    }
  }
}

TEST_F(Jacobians, JointsEqualCentralDifferences) {
  const Skeleton& skeleton = character_.skeleton;
  const VectorXd pose = RandomPose();
  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  MatrixXd jacobian;
  JointJacobian(skeleton, state, &jacobian);
  const auto joints = [&](const VectorXd& x) -> VectorXd {
    KinematicState moved;
    ForwardKinematics(skeleton, x, &moved);
    return moved.joints.reshaped();
  };
  testing::CheckJacobian(joints, Plus, pose, jacobian, 1e-7);
}

TEST_F(Jacobians, VerticesEqualAutomaticDifferentiation) {
  const int num_vertices = static_cast<int>(character_.mesh.positions.cols());
  int blended = 0;
  for (int trial = 0; trial < 10; ++trial) {
    const VectorXd pose = RandomPose();
    KinematicState state;
    ForwardKinematics(character_.skeleton, pose, &state);
    const TwinState<Jet> twin = TwinKinematics(character_.skeleton, pose, Jets(pose));
    for (int v = trial; v < num_vertices; v += 7) {
      Eigen::Matrix3Xd jacobian;
      const Eigen::Vector3d x = SkinnedVertex(character_, state, v, &jacobian);
      const Vector3<Jet> expected = TwinVertex(character_, twin, v);
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(expected[i].a, x[i], 1e-12);
        EXPECT_LT((expected[i].v.transpose() - jacobian.row(i)).cwiseAbs().maxCoeff(), 1e-10)
            << "vertex " << v;
      }
      blended += character_.weights(0, v) < 1 ? 1 : 0;
    }
  }
  EXPECT_GT(blended, 100);
}

TEST_F(Jacobians, VerticesEqualCentralDifferences) {
  const VectorXd pose = RandomPose();
  KinematicState state;
  ForwardKinematics(character_.skeleton, pose, &state);
  for (int v = 3; v < character_.mesh.positions.cols(); v += 60) {
    Eigen::Matrix3Xd jacobian;
    SkinnedVertex(character_, state, v, &jacobian);
    const auto vertex = [&](const VectorXd& x) -> VectorXd {
      KinematicState moved;
      ForwardKinematics(character_.skeleton, x, &moved);
      return SkinnedVertex(character_, moved, v);
    };
    testing::CheckJacobian(vertex, Plus, pose, jacobian, 1e-7);
  }
}

TEST_F(Jacobians, VerticesEqualTheFloatKernel) {
  KinematicState state;
  ForwardKinematics(character_.skeleton, RandomPose(), &state);
  Eigen::Matrix3Xf skinned;
  SkinCharacter(character_, state, &skinned);
  for (int v = 0; v < skinned.cols(); ++v) {
    const Eigen::Vector3d x = SkinnedVertex(character_, state, v);
    EXPECT_LT((x - skinned.col(v).cast<double>()).norm(), 1e-5);
  }
}

TEST_F(Jacobians, ManyVerticesAtOnceEqualOneByOne) {
  VertexSkinner skinner(character_);
  for (int trial = 0; trial < 5; ++trial) {
    const Eigen::Vector3d direction = Eigen::Vector3d::Random();
    KinematicState state;
    ForwardKinematics(character_.skeleton, RandomPose(), &state);
    skinner.Update(state);
    VectorXd row = VectorXd::Constant(character_.skeleton.num_dofs(), 7);
    for (int v = trial; v < character_.mesh.positions.cols(); v += 7) {
      Eigen::Matrix3Xd jacobian;
      EXPECT_LT((SkinnedVertex(character_, state, v, &jacobian) - skinner.Position(v)).norm(),
                1e-12);
      skinner.Derivative(v, direction, row);
      EXPECT_LT((jacobian.transpose() * direction - row).norm(), 1e-11) << "vertex " << v;
    }
  }
}

TEST_F(Jacobians, AVertexOutOfRangeIsRefused) {
  EXPECT_MPC_ERROR(SkinnedVertex(character_, character_.bind, -1), kInvalidArgument, "vertex -1");
  const int end = static_cast<int>(character_.mesh.positions.cols());
  EXPECT_MPC_ERROR(SkinnedVertex(character_, character_.bind, end), kInvalidArgument, "vertex");
}

}  // namespace
}  // namespace mpc
