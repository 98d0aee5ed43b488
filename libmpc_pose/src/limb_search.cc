#include "mpc/pose/limb_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "mpc/core/rigid.h"
#include "mpc/core/thread_pool.h"
#include "mpc/pose/frame_solver.h"

namespace mpc {
namespace {

constexpr int kNumCandidates = 5;  // as is, three mirrored combinations, as detected
// Lasting errors: evidence of this many seconds counts as one independent observation.
constexpr double kEvidenceSeconds = 0.25;
constexpr double kSpeed = 2.0;    // m/s of a joint relative to the torso that is free
constexpr double kJitter = 0.1;   // m beyond it that cost 1
constexpr double kMaxJump = 0.5;  // m; longer jumps cost no more

// A limb as a skeleton of its own: the root is the torso segment it hangs on.
struct Limb {
  Skeleton skeleton;
  int anchor = 0;                // segment of the whole skeleton
  std::vector<int> hinges;       // of the whole skeleton, per hinge of the limb
  std::vector<int> joint_index;  // per joint of the whole skeleton: joint of the limb or -1
};

Limb MakeLimb(const Skeleton& skeleton, int first_segment) {
  Limb limb;
  limb.anchor = skeleton.segments[first_segment].parent;
  std::vector<int> segment_index(skeleton.num_segments(), -1);
  limb.skeleton.segments.push_back({skeleton.segments[limb.anchor].name, -1, {}, {}});
  limb.skeleton.segments[0].offset.setZero();
  limb.skeleton.segments[0].rest_rotation.setIdentity();
  for (int s = first_segment; s < skeleton.num_segments(); ++s) {
    const int parent = skeleton.segments[s].parent;
    if (s != first_segment && segment_index[parent] < 0) continue;
    segment_index[s] = limb.skeleton.num_segments();
    limb.skeleton.segments.push_back(skeleton.segments[s]);
    limb.skeleton.segments.back().parent = s == first_segment ? 0 : segment_index[parent];
  }
  for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
    const int s = segment_index[skeleton.hinges[h].segment];
    if (s < 0) continue;
    limb.hinges.push_back(static_cast<int>(h));
    limb.skeleton.hinges.push_back(skeleton.hinges[h]);
    limb.skeleton.hinges.back().segment = s;
  }
  limb.joint_index.assign(skeleton.num_joints(), -1);
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const int s = segment_index[skeleton.joints[j].segment];
    if (s < 0) continue;
    limb.joint_index[j] = limb.skeleton.num_joints();
    limb.skeleton.joints.push_back(skeleton.joints[j]);
    limb.skeleton.joints.back().segment = s;
  }
  return limb;
}

std::vector<Limb> MakeLimbs(const Skeleton& skeleton) {
  std::vector<Limb> limbs;
  for (const JointId id :
       {JointId::kLeftShoulder, JointId::kRightShoulder, JointId::kLeftHip, JointId::kRightHip}) {
    const int joint = skeleton.FindJointIndex(id);
    const int segment = joint < 0 ? 0 : skeleton.joints[joint].segment;
    if (segment > 0) limbs.push_back(MakeLimb(skeleton, segment));
  }
  return limbs;
}

struct Candidate {
  Eigen::VectorXd angles;
  double cost = std::numeric_limits<double>::infinity();
  Eigen::Matrix3Xd joints;  // in the torso segment
};
using Candidates = std::array<Candidate, kNumCandidates>;

// The limb's bones as they are posed, with the ray component of the upper bone reversed where `mask`
// has bit 0, of the lower bone where it has bit 1.
BoneVectorEnergy MirroredBones(const Limb& limb, const FrameProblem& problem,
                               const Eigen::Matrix3Xd& joints,
                               const Eigen::Matrix3d& camera_from_ray, int mask) {
  std::vector<BoneObservation> bones;
  for (BoneObservation bone : problem.bone_vectors.bones()) {
    bone.vector = joints.col(bone.b) - joints.col(bone.a);
    bone.weight = 1;
    const int level = limb.skeleton.joints[bone.a].segment - 1;  // 0 upper, 1 lower, 2 foot
    if (level < 2 && ((mask >> level) & 1) != 0) {
      const Eigen::Vector3d ray = camera_from_ray.col(2);
      bone.vector -= 2 * ray.dot(bone.vector) * ray;
    }
    bones.push_back(bone);
  }
  return {std::move(bones), camera_from_ray, {}};
}

class LimbFitter {
 public:
  LimbFitter(const ClipEvidence& evidence, const Limb& limb) : evidence_(evidence), limb_(limb) {
    options_ = evidence.options().frame_solver;
    options_.fixed_root = true;
    relaxed_ = RelaxedPose(evidence.skeleton());
  }

  Candidates Fit(const FrameObservation& observation, const Eigen::VectorXd& pose) {
    Candidates candidates;
    KinematicState state;
    ForwardKinematics(evidence_.skeleton(), pose, &state);
    Eigen::VectorXd start(limb_.skeleton.num_dofs());
    start.head<3>() = state.origins.col(limb_.anchor);
    start.segment<3>(3) = LogSO3(state.rotations[limb_.anchor]);
    Eigen::VectorXd rest = start;
    for (size_t h = 0; h < limb_.hinges.size(); ++h) {
      start[6 + h] = pose[6 + limb_.hinges[h]];
      rest[6 + h] = relaxed_[6 + limb_.hinges[h]];
    }
    const auto problem = [&](double loss_width) {
      return evidence_.MakeProblem(observation, PersonDepth(pose), loss_width, relaxed_)
          .Restricted(limb_.joint_index, limb_.hinges);
    };
    const FrameProblem narrow = problem(1);
    ForwardKinematics(limb_.skeleton, start, &state);
    const Eigen::Matrix3Xd joints = state.joints;
    for (int c = 0; c < kNumCandidates; ++c) {
      Eigen::VectorXd limb_pose = start;
      if (c == kNumCandidates - 1) {
        limb_pose = rest;
        SolveFrame(limb_.skeleton, problem(0), options_, &limb_pose, &scratch_);
      } else if (c > 0) {
        FrameProblem mirrored;
        mirrored.bone_vectors =
            MirroredBones(limb_, narrow, joints, observation.camera_from_ray, c);
        mirrored.rest_prior = narrow.rest_prior;
        SolveFrame(limb_.skeleton, mirrored, options_, &limb_pose, &scratch_);
      }
      Candidate& candidate = candidates[c];
      candidate.cost =
          SolveFrame(limb_.skeleton, narrow, options_, &limb_pose, &scratch_).final_cost;
      candidate.angles = limb_pose.tail(static_cast<Eigen::Index>(limb_.hinges.size()));
      limb_pose.head<6>().setZero();
      ForwardKinematics(limb_.skeleton, limb_pose, &state);
      candidate.joints = state.joints.leftCols(PaperJoints());
    }
    return candidates;
  }

 private:
  // Extra points follow the paper's joints and add nothing to continuity.
  int PaperJoints() const {
    int count = 0;
    for (const SkeletonJoint& joint : limb_.skeleton.joints) {
      count += static_cast<int>(joint.id) < kNumPaperJoints ? 1 : 0;
    }
    return count;
  }

  const ClipEvidence& evidence_;
  const Limb& limb_;
  FrameSolveOptions options_;
  Eigen::VectorXd relaxed_;
  FrameSolveScratch scratch_;
};

double TransitionCost(const Candidate& a, const Candidate& b, double seconds) {
  double cost = 0;
  for (int j = 0; j < a.joints.cols(); ++j) {
    const double jump = std::min(kMaxJump, (a.joints.col(j) - b.joints.col(j)).norm());
    const double excess = std::max(0.0, jump - kSpeed * seconds) / kJitter;
    cost += excess * excess;
  }
  return cost;
}

// Index of the chosen candidate of each of the frames, which lie `seconds` apart.
std::vector<int> BestPath(const std::vector<const Candidates*>& frames, double seconds,
                          double lasting_share) {
  const double evidence_weight =
      seconds / std::max(seconds, lasting_share * kEvidenceSeconds) / kNoiseCost;
  std::vector<std::array<double, kNumCandidates>> cost(frames.size());
  std::vector<std::array<int, kNumCandidates>> from(frames.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    for (int c = 0; c < kNumCandidates; ++c) {
      double best = i == 0 ? 0 : std::numeric_limits<double>::infinity();
      from[i][c] = 0;
      for (int p = 0; i > 0 && p < kNumCandidates; ++p) {
        const double through =
            cost[i - 1][p] + TransitionCost((*frames[i - 1])[p], (*frames[i])[c], seconds);
        if (through < best) {
          best = through;
          from[i][c] = p;
        }
      }
      cost[i][c] = best + evidence_weight * (*frames[i])[c].cost;
    }
  }
  std::vector<int> path(frames.size());
  path.back() = static_cast<int>(std::min_element(cost.back().begin(), cost.back().end()) -
                                 cost.back().begin());
  for (size_t i = frames.size() - 1; i > 0; --i) path[i - 1] = from[i][path[i]];
  return path;
}

}  // namespace

void ChooseLimbs(const ClipEvidence& evidence, const FrameInitialization& initialization,
                 Eigen::MatrixXd* poses) {
  const int num_frames = static_cast<int>(poses->cols());
  const std::vector<Limb> limbs = MakeLimbs(evidence.skeleton());
  std::vector<std::vector<Candidates>> candidates(num_frames);
  ParallelFor(num_frames, evidence.options().num_threads, [&](int f) {
    if (!initialization.observed[f]) return;
    for (const Limb& limb : limbs) {
      candidates[f].push_back(
          LimbFitter(evidence, limb).Fit(initialization.observations[f], poses->col(f)));
    }
  });
  for (int begin = 0; begin < num_frames;) {
    int end = begin;
    while (end < num_frames && initialization.observed[end]) ++end;
    for (size_t l = 0; begin < end && l < limbs.size(); ++l) {
      std::vector<const Candidates*> frames;
      for (int f = begin; f < end; ++f) frames.push_back(&candidates[f][l]);
      const std::vector<int> path =
          BestPath(frames, 1 / evidence.fps(), 1 - evidence.white_share());
      for (int f = begin; f < end; ++f) {
        if (path[f - begin] == 0) continue;  // as it is
        const Candidate& chosen = candidates[f][l][path[f - begin]];
        for (size_t h = 0; h < limbs[l].hinges.size(); ++h) {
          (*poses)(6 + limbs[l].hinges[h], f) = chosen.angles[h];
        }
      }
    }
    begin = end + 1;
  }
}

}  // namespace mpc
