#include "mpc/skeleton/skinning.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/skeleton/rig_pose.h"
#include "support/expect_error.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

using Eigen::Matrix3Xf;
using Eigen::MatrixXf;
using Eigen::MatrixXi;
using Eigen::Vector3d;
using Eigen::Vector3f;

DualQuaternion Motion(const Eigen::Quaterniond& rotation, const Vector3d& translation) {
  const Eigen::Quaterniond dual =
      Eigen::Quaterniond(0, translation.x() / 2, translation.y() / 2, translation.z() / 2) *
      rotation;
  DualQuaternion motion;
  motion.real << static_cast<float>(rotation.w()), rotation.vec().cast<float>();
  motion.dual << static_cast<float>(dual.w()), dual.vec().cast<float>();
  return motion;
}

// A random cloud with random weights on random segments.
class Skinning : public ::testing::Test {
 protected:
  static constexpr int kVertices = 1003;  // not a multiple of the kernel's width
  static constexpr int kInfluences = 4;
  static constexpr int kSegments = 14;

  Skinning() { Fill(kVertices, kInfluences, kSegments); }

  void Fill(int num_vertices, int num_influences, int num_segments) {
    positions_.resize(3, num_vertices);
    segments_.resize(num_influences, num_vertices);
    weights_.resize(num_influences, num_vertices);
    for (float& x : positions_.reshaped()) x = static_cast<float>(Uniform(-1, 1));
    std::uniform_int_distribution<int> segment(0, num_segments - 1);
    for (int& s : segments_.reshaped()) s = segment(rng_);
    for (float& w : weights_.reshaped()) w = static_cast<float>(Uniform(0.01, 1));
    for (int v = 0; v < num_vertices; ++v) weights_.col(v) /= weights_.col(v).sum();
    for (int s = 0; s < num_segments; ++s) {
      rotations_.push_back(RandomRotation(0.6));
      translations_.push_back(Vector3d(Uniform(-1, 1), Uniform(-1, 1), Uniform(2, 4)));
    }
    out_.resize(3, num_vertices);
    twin_.resize(3, num_vertices);
  }

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  Eigen::Quaterniond RandomRotation(double max_angle) {
    const Vector3d axis(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1));
    return Eigen::Quaterniond(Eigen::AngleAxisd(Uniform(0, max_angle), axis.normalized()));
  }
  std::vector<DualQuaternion> Motions() const {
    std::vector<DualQuaternion> motions;
    for (size_t s = 0; s < rotations_.size(); ++s) {
      motions.push_back(Motion(rotations_[s], translations_[s]));
    }
    return motions;
  }
  // Largest distance between out_ and twin_ as a fraction of the largest coordinate.
  float RelativeDifference() const {
    return (out_ - twin_).cwiseAbs().maxCoeff() / twin_.cwiseAbs().maxCoeff();
  }

  std::mt19937 rng_{3};
  Matrix3Xf positions_, out_, twin_;
  MatrixXi segments_;
  MatrixXf weights_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::vector<Vector3d> translations_;
};

TEST_F(Skinning, OneBoneIsRigid) {
  segments_.setConstant(5);
  SkinDualQuaternion(positions_, segments_, weights_, Motions(), &out_);
  SkinLinearBlend(positions_, segments_, weights_, Motions(), &twin_);
  for (int v = 0; v < kVertices; ++v) {
    const Vector3d x = positions_.col(v).cast<double>();
    const Vector3d rigid = rotations_[5] * x + translations_[5];
    EXPECT_LT((out_.col(v).cast<double>() - rigid).norm(), 4e-6);
    EXPECT_LT((twin_.col(v).cast<double>() - rigid).norm(), 4e-6);
  }
}

TEST_F(Skinning, KernelEqualsItsScalarTwin) {
  for (const int num_vertices : {0, 1, 7, 8, 9, 16, 1003}) {
    for (const int num_influences : {1, 2, 3, 4, 5}) {
      Fill(num_vertices, num_influences, kSegments);
      SkinDualQuaternion(positions_, segments_, weights_, Motions(), &out_);
      SkinDualQuaternionScalar(positions_, segments_, weights_, Motions(), &twin_);
      if (num_vertices > 0) {
        EXPECT_LT(RelativeDifference(), 1e-6) << num_vertices << " " << num_influences;
      }
    }
  }
}

TEST_F(Skinning, MoreSegmentsThanTheKernelsTableWork) {
  Fill(kVertices, kInfluences, 200);
  SkinDualQuaternion(positions_, segments_, weights_, Motions(), &out_);
  SkinDualQuaternionScalar(positions_, segments_, weights_, Motions(), &twin_);
  EXPECT_LT(RelativeDifference(), 1e-6);
}

TEST_F(Skinning, TheSignOfAQuaternionDoesNotMatter) {
  std::vector<DualQuaternion> motions = Motions();
  SkinDualQuaternion(positions_, segments_, weights_, motions, &twin_);
  for (size_t s = 0; s < motions.size(); s += 2) {
    motions[s].real = -motions[s].real;
    motions[s].dual = -motions[s].dual;
  }
  SkinDualQuaternion(positions_, segments_, weights_, motions, &out_);
  EXPECT_LT(RelativeDifference(), 1e-6);
  SkinDualQuaternionScalar(positions_, segments_, weights_, motions, &out_);
  EXPECT_LT(RelativeDifference(), 1e-6);
  SkinLinearBlend(positions_, segments_, weights_, Motions(), &twin_);
  SkinLinearBlend(positions_, segments_, weights_, motions, &out_);
  EXPECT_LT(RelativeDifference(), 1e-6);
}

TEST_F(Skinning, CommutesWithAGlobalMotion) {
  SkinDualQuaternion(positions_, segments_, weights_, Motions(), &twin_);
  const Eigen::Quaterniond global = RandomRotation(3);
  const Vector3d shift(0.3, -0.5, 0.7);
  for (size_t s = 0; s < rotations_.size(); ++s) {
    rotations_[s] = global * rotations_[s];
    translations_[s] = global * translations_[s] + shift;
  }
  SkinDualQuaternion(positions_, segments_, weights_, Motions(), &out_);
  for (int v = 0; v < kVertices; ++v) {
    const Vector3f moved = (global * twin_.col(v).cast<double>() + shift).cast<float>();
    EXPECT_LT((out_.col(v) - moved).norm(), 1e-5f);
  }
}

TEST_F(Skinning, LinearBlendIsTheWeightedMeanOfRigidMotions) {
  SkinLinearBlend(positions_, segments_, weights_, Motions(), &out_);
  for (int v = 0; v < kVertices; ++v) {
    const Vector3d x = positions_.col(v).cast<double>();
    Vector3d mean = Vector3d::Zero();
    for (int k = 0; k < kInfluences; ++k) {
      const int s = segments_(k, v);
      mean += weights_(k, v) * (rotations_[s] * x + translations_[s]);
    }
    EXPECT_LT((out_.col(v).cast<double>() - mean).norm(), 5e-6);
  }
}

// Halfway between rest and a rotation by t about a point, dual quaternions rotate by t/2 about it.
TEST_F(Skinning, HalfwayIsHalfTheScrew) {
  const Vector3d pivot(0.2, 1, -0.3);
  const auto about_pivot = [&](double angle) {
    return Eigen::AngleAxisd(angle, Vector3d::UnitZ()).toRotationMatrix();
  };
  const Eigen::Matrix3d full = about_pivot(1.4);
  const std::vector<DualQuaternion> motions = {
      {}, Motion(Eigen::Quaterniond(full), pivot - full * pivot)};
  Fill(kVertices, 2, 2);
  for (int v = 0; v < kVertices; ++v) segments_.col(v) << 0, 1;
  weights_.setConstant(0.5f);
  SkinDualQuaternion(positions_, segments_, weights_, motions, &out_);
  for (int v = 0; v < kVertices; ++v) {
    const Vector3d x = positions_.col(v).cast<double>();
    EXPECT_LT((out_.col(v).cast<double>() - (about_pivot(0.7) * (x - pivot) + pivot)).norm(), 2e-6);
  }
}

TEST_F(Skinning, AntipodalAndMissingWeightsStayFinite) {
  // Half turns about x and y: orthogonal to the identity and to each other; q and -q cancel if the
  // pivot weighs nothing.
  std::vector<DualQuaternion> motions(4);
  motions[1].real = {0, 1, 0, 0};
  motions[2].real = {0, -1, 0, 0};
  motions[3].real = {-1, 0, 0, 0};
  Fill(kVertices, 3, 4);
  for (int v = 0; v < kVertices; ++v) segments_.col(v) << v % 4, (v / 4) % 4, (v / 16) % 4;
  for (const Vector3f& weight :
       {Vector3f(0, 0.5f, 0.5f), Vector3f(0.5f, 0.5f, 0), Vector3f(0, 0, 0), Vector3f(1, 0, 0),
        Vector3f(0.4f, 0.3f, 0.3f)}) {
    weights_.colwise() = weight;
    SkinDualQuaternion(positions_, segments_, weights_, motions, &out_);
    EXPECT_TRUE(out_.allFinite());
    SkinDualQuaternionScalar(positions_, segments_, weights_, motions, &twin_);
    EXPECT_TRUE(twin_.allFinite());
    EXPECT_LT((out_ - twin_).cwiseAbs().maxCoeff(), 1e-5f);
  }
}

TEST_F(Skinning, SizesThatDoNotFitAreRefused) {
  const auto skin = [&] { SkinDualQuaternion(positions_, segments_, weights_, Motions(), &out_); };
  EXPECT_NO_THROW(skin());
  out_.resize(3, 5);
  EXPECT_MPC_ERROR(skin(), kInvalidArgument, "into 5 other vertices");
  out_.resize(3, kVertices);
  weights_.conservativeResize(3, kVertices);
  EXPECT_MPC_ERROR(skin(), kInvalidArgument, "3x1003 weights");
  EXPECT_MPC_ERROR(SkinLinearBlend(positions_, segments_, weights_, Motions(), &out_),
                   kInvalidArgument, "sizes do not fit");
}

class CharacterSkinning : public ::testing::Test {
 protected:
  // The bind pose plus noise of `spread` on every dof.
  KinematicState Posed(double spread) {
    Eigen::VectorXd pose = character_.bind_pose;
    std::normal_distribution<double> normal(0, spread);
    for (double& x : pose) x += normal(rng_);
    KinematicState state;
    ForwardKinematics(character_.skeleton, pose, &state);
    return state;
  }

  std::mt19937 rng_{11};
  RigAsset rig_ = testing::MakeTestRig({.arm_down_rad = 0.8, .bone_rotations = true});
  Character character_ = BuildCharacter(rig_, MapRigByNames(rig_));
};

TEST_F(CharacterSkinning, BindPoseLeavesTheMeshAlone) {
  Matrix3Xf out;
  SkinCharacter(character_, character_.bind, &out);
  EXPECT_LT((out - character_.mesh.positions).cwiseAbs().maxCoeff(), 1e-6f);
}

// Dual-quaternion skinning by the rig's own bones, weights as in the file.
TEST_F(CharacterSkinning, RigBonesMakeTheSameMesh) {
  for (int trial = 0; trial < 5; ++trial) {
    const KinematicState state = Posed(0.3);
    Matrix3Xf by_segments;
    SkinCharacter(character_, state, &by_segments);
    std::vector<Eigen::Affine3d> body_from_bone;
    RigBoneTransforms(rig_, character_, state, &body_from_bone);
    std::vector<DualQuaternion> motions;
    for (size_t b = 0; b < rig_.bones.size(); ++b) {
      const Eigen::Affine3d motion = body_from_bone[b] * rig_.bones[b].scene_from_bone.inverse();
      motions.push_back(Motion(Eigen::Quaterniond(motion.linear()), motion.translation()));
    }
    const RigMesh& mesh = rig_.meshes[0];
    Matrix3Xf by_bones(3, mesh.mesh.positions.cols());
    SkinDualQuaternion(mesh.mesh.positions, mesh.bones, mesh.weights, motions, &by_bones);
    EXPECT_LT((by_bones - by_segments).cwiseAbs().maxCoeff(), 5e-6f);
  }
}

TEST_F(CharacterSkinning, AStateOfAnotherSkeletonIsRefused) {
  KinematicState state = character_.bind;
  state.rotations.pop_back();
  std::vector<DualQuaternion> motions;
  EXPECT_MPC_ERROR(SegmentMotions(character_.bind, state, &motions), kMismatch, "14 segments");
}

}  // namespace
}  // namespace mpc
