#include "mpc/eval/clothing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cloth_simulator.h"
#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

constexpr double kStepS = 1.0 / 480;
constexpr double kDressingS = 0.6;      // from bind to the first pose
constexpr double kRestS = 1.0;          // at the first pose, before frame 0
constexpr double kDamping = 1.2;        // per second
constexpr double kDressingDamping = 8;  // so that it comes to rest soon
constexpr double kMaxStartSpeed = 4;    // m/s

void CheckArguments(const DressedActor& actor, const Character& character,
                    const Eigen::MatrixXd& poses, double fps) {
  const auto num_vertices = static_cast<int>(character.mesh.positions.cols());
  const auto num_particles = actor.cloth.particle.size();
  if (actor.rig.num_vertices() != num_vertices ||
      (num_particles != 0 && num_particles != static_cast<size_t>(num_vertices)) ||
      character.bone_segment.size() != actor.rig.bones.size()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("the actor has {} vertices ({} of them with cloth data) and {} bones, "
                            "the character {} and {}",
                            actor.rig.num_vertices(), num_particles, actor.rig.bones.size(),
                            num_vertices, character.bone_segment.size()));
  }
  if (poses.rows() != character.skeleton.num_dofs() || !poses.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("poses must be {} finite numbers each, found {} rows",
                            character.skeleton.num_dofs(), poses.rows()));
  }
  if (!(fps >= 1 && fps <= 1000)) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("fps is {}, expected 1 to 1000", fps));
  }
}

// Translation and angles between two poses, the root turned by the shorter way.
Eigen::VectorXd Between(const Eigen::VectorXd& from, const Eigen::VectorXd& to, double t) {
  Eigen::VectorXd pose = from + t * (to - from);
  const Eigen::Matrix3d start = ExpSO3(from.segment<3>(3));
  const Eigen::Matrix3d turn = start.transpose() * ExpSO3(to.segment<3>(3));
  pose.segment<3>(3) = LogSO3(start * ExpSO3(t * LogSO3(turn)));
  return pose;
}

// Where the bones hold particles and colliders, at any pose.
class Dummy {
 public:
  Dummy(const DressedActor& actor, const Character& character)
      : cloth_(actor.cloth), character_(character) {
    std::vector<int> vertex(static_cast<size_t>(cloth_.num_particles()), -1);
    for (size_t v = cloth_.particle.size(); v-- > 0;) {
      if (cloth_.particle[v] >= 0) vertex[cloth_.particle[v]] = static_cast<int>(v);
    }
    rest_ = character.mesh.positions(Eigen::all, vertex);
    segments_ = character.segments(Eigen::all, vertex);
    weights_ = character.weights(Eigen::all, vertex);
    skinned_.resize(3, rest_.cols());
    colliders.resize(cloth_.colliders.size());
  }

  void Pose(const Eigen::VectorXd& pose) {
    ForwardKinematics(character_.skeleton, pose, &state_);
    SegmentMotions(character_.bind, state_, &motions_);
    SkinDualQuaternion(rest_, segments_, weights_, motions_, &skinned_);
    targets = skinned_.cast<double>();
    for (size_t c = 0; c < colliders.size(); ++c) {
      const int segment = character_.bone_segment[cloth_.colliders[c].bone];
      const Eigen::Matrix3d rotation =
          state_.rotations[segment] * character_.bind.rotations[segment].transpose();
      const auto moved = [&](const Eigen::Vector3d& x) {
        return Eigen::Vector3d(state_.origins.col(segment) +
                               rotation * (x - character_.bind.origins.col(segment)));
      };
      colliders[c] = cloth_.colliders[c].capsule;
      colliders[c].a = moved(colliders[c].a);
      colliders[c].b = moved(colliders[c].b);
    }
  }

  Eigen::Matrix3Xd targets;
  CapsuleSet colliders;

 private:
  const ClothModel& cloth_;
  const Character& character_;
  Eigen::Matrix3Xf rest_, skinned_;
  Eigen::MatrixXi segments_;
  Eigen::MatrixXf weights_;
  KinematicState state_;
  std::vector<DualQuaternion> motions_;
};

// Puts the cloth on: from the bind pose into the first pose while moving as the body will, then at
// rest in it.
ClothSimulator Dressed(const ClothModel& cloth, const Character& character,
                       const Eigen::MatrixXd& poses, double fps, Dummy* dummy) {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  if (poses.cols() > 1) velocity = fps * (poses.col(1) - poses.col(0)).head<3>();
  velocity.y() = 0;
  if (velocity.norm() > kMaxStartSpeed) velocity *= kMaxStartSpeed / velocity.norm();
  Eigen::VectorXd bind = character.bind_pose;
  bind.head<6>() = poses.col(0).head<6>();
  const int steps = static_cast<int>(std::lround((kDressingS + kRestS) / kStepS));
  const auto pose_at = [&](int step) {
    const double t = std::min(1.0, step * kStepS / kDressingS);
    Eigen::VectorXd pose = Between(bind, poses.col(0), t * t * (3 - 2 * t));
    pose.head<3>() += (step - steps) * kStepS * velocity;
    return pose;
  };
  dummy->Pose(pose_at(0));
  ClothSimulator simulator(cloth, dummy->targets, dummy->colliders);
  simulator.Push(velocity);
  for (int step = 1; step <= steps; ++step) {
    dummy->Pose(pose_at(step));
    simulator.Step(kStepS, dummy->targets, dummy->colliders, kDressingDamping);
  }
  return simulator;
}

}  // namespace

std::vector<Eigen::Matrix3Xf> Perform(const DressedActor& actor, const Character& character,
                                      const Eigen::MatrixXd& poses_in_world, double fps,
                                      const ProgressCallback& progress) {
  CheckArguments(actor, character, poses_in_world, fps);
  std::vector<Eigen::Matrix3Xf> frames(static_cast<size_t>(poses_in_world.cols()));
  KinematicState state;
  for (Eigen::Index f = 0; f < poses_in_world.cols(); ++f) {
    ForwardKinematics(character.skeleton, poses_in_world.col(f), &state);
    SkinCharacter(character, state, &frames[f]);
  }
  if (actor.cloth.num_particles() == 0 || frames.empty()) return frames;

  Dummy dummy(actor, character);
  ClothSimulator simulator = Dressed(actor.cloth, character, poses_in_world, fps, &dummy);
  const int substeps = std::max(1, static_cast<int>(std::lround(1 / (fps * kStepS))));
  const auto num_frames = static_cast<int>(poses_in_world.cols());
  for (int f = 0; f < num_frames; ++f) {
    if (progress && !progress({"cloth", f, num_frames})) {
      throw Error(ErrorCode::kCancelled, "interrupted");
    }
    for (int i = 1; f > 0 && i <= substeps; ++i) {
      dummy.Pose(Between(poses_in_world.col(f - 1), poses_in_world.col(f),
                         static_cast<double>(i) / substeps));
      simulator.Step(1 / (fps * substeps), dummy.targets, dummy.colliders, kDamping);
    }
    for (Eigen::Index v = 0; v < frames[f].cols(); ++v) {
      const int particle = actor.cloth.particle[v];
      if (particle >= 0) frames[f].col(v) = simulator.positions().col(particle).cast<float>();
    }
  }
  return frames;
}

}  // namespace mpc
