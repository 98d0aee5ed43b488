#include "mpc/pose/limb_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "mpc/core/rigid.h"
#include "mpc/core/thread_pool.h"
#include "mpc/pose/frame_solver.h"

namespace mpc {
namespace {

constexpr int kNumMirrored = 3;  // of two bones
// As is, fitted with mirrored depths, then to the evidence from there, as detected.
constexpr int kNumCandidates = 2 + 2 * kNumMirrored;
// Lasting errors: evidence of this many seconds counts as one independent observation.
constexpr double kEvidenceSeconds = 0.1;
constexpr double kSpeed = 2.0;      // m/s of a joint relative to the torso that is free
constexpr double kJitter = 0.1;     // m beyond it that cost 1
constexpr double kMaxJump = 0.5;    // m; longer jumps cost no more
constexpr double kSameLimb = 0.02;  // m between joints of candidates that are the same
// Candidates are tried this many seconds apart; a mirrored limb lasts longer.
constexpr double kSampleSeconds = 1.0 / 15;
constexpr double kTolerance = 1e-2;  // of the candidates' costs, relative

// A limb as a skeleton of its own: the root is the torso segment it hangs on.
struct Limb {
  Skeleton skeleton;
  int anchor = 0;                // segment of the whole skeleton
  std::vector<int> hinges;       // of the whole skeleton, per hinge of the limb
  std::vector<int> joint_index;  // per joint of the whole skeleton: joint of the limb or -1
  int num_paper_joints = 0;      // the first ones; extra points add nothing to continuity
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
    limb.num_paper_joints += static_cast<int>(skeleton.joints[j].id) < kNumPaperJoints ? 1 : 0;
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
    const int level = limb.skeleton.joints[bone.a].segment - 1;  // 0 upper, 1 lower, 2 foot
    if (level < 2 && ((mask >> level) & 1) != 0) {
      const Eigen::Vector3d ray = camera_from_ray.col(2);
      bone.vector -= 2 * ray.dot(bone.vector) * ray;
    }
    bones.push_back(bone);
  }
  return {std::move(bones), camera_from_ray, {}};
}

// Fits the candidates of one frame's limbs with its torso held.
class LimbFitter {
 public:
  LimbFitter(const ClipEvidence& evidence, const FrameObservation& observation,
             const Eigen::VectorXd& pose)
      : pose_(pose),
        relaxed_(RelaxedPose(evidence.skeleton())),
        narrow_(evidence.MakeProblem(observation, PersonDepth(pose), 1, relaxed_)),
        wide_(evidence.MakeProblem(observation, PersonDepth(pose), 0, relaxed_)),
        camera_from_ray_(observation.camera_from_ray),
        options_(evidence.options().frame_solver) {
    ForwardKinematics(evidence.skeleton(), pose, &body_);
    options_.fixed_root = true;
    options_.relative_tolerance = std::max(options_.relative_tolerance, kTolerance);
  }

  Candidates Fit(const Limb& limb) {
    Candidates candidates;
    const FrameProblem narrow = narrow_.Restricted(limb.joint_index, limb.hinges);
    const Eigen::VectorXd start = Start(limb, pose_);
    candidates[0] = Solved(limb, narrow, start);
    KinematicState state;
    ForwardKinematics(limb.skeleton, start, &state);
    for (int mask = 1; mask <= kNumMirrored; ++mask) {
      FrameProblem mirrored = narrow;
      mirrored.bone_vectors = MirroredBones(limb, narrow, state.joints, camera_from_ray_, mask);
      Eigen::VectorXd pose = start;
      SolveFrame(limb.skeleton, mirrored, options_, &pose, &scratch_);
      candidates[mask] = Evaluated(limb, narrow, pose);
      candidates[kNumMirrored + mask] = Solved(limb, narrow, pose);
    }
    Eigen::VectorXd detected = Start(limb, relaxed_);
    SolveFrame(limb.skeleton, wide_.Restricted(limb.joint_index, limb.hinges), options_, &detected,
               &scratch_);
    candidates.back() = Solved(limb, narrow, detected);
    // What ends where the limb is already is no other hypothesis.
    for (int c = 1; c < kNumCandidates; ++c) {
      if (Distance(candidates[c], candidates[0]) < kSameLimb) {
        candidates[c].cost = std::numeric_limits<double>::infinity();
      }
    }
    return candidates;
  }

 private:
  // The limb with the angles of `whole`, where it hangs on the body.
  Eigen::VectorXd Start(const Limb& limb, const Eigen::VectorXd& whole) const {
    Eigen::VectorXd pose(limb.skeleton.num_dofs());
    pose.head<3>() = body_.origins.col(limb.anchor);
    pose.segment<3>(3) = LogSO3(body_.rotations[limb.anchor]);
    for (size_t h = 0; h < limb.hinges.size(); ++h) pose[6 + h] = whole[6 + limb.hinges[h]];
    return pose;
  }

  Candidate Solved(const Limb& limb, const FrameProblem& problem, Eigen::VectorXd pose) {
    const double cost = SolveFrame(limb.skeleton, problem, options_, &pose, &scratch_).final_cost;
    return MakeCandidate(limb, std::move(pose), cost);
  }

  Candidate Evaluated(const Limb& limb, const FrameProblem& problem, Eigen::VectorXd pose) {
    PosePoint& at = scratch_.current;
    at.pose = pose;
    at.root_rotation = body_.rotations[limb.anchor];
    at.Update(limb.skeleton, /*with_jacobian=*/false);
    const double cost = EvaluateFrame(problem, at, &scratch_.evaluation);
    return MakeCandidate(limb, std::move(pose), cost);
  }

  static Candidate MakeCandidate(const Limb& limb, Eigen::VectorXd pose, double cost) {
    Candidate candidate;
    candidate.cost = cost;
    candidate.angles = pose.tail(static_cast<Eigen::Index>(limb.hinges.size()));
    pose.head<6>().setZero();
    KinematicState state;
    ForwardKinematics(limb.skeleton, pose, &state);
    candidate.joints = state.joints.leftCols(limb.num_paper_joints);
    return candidate;
  }

  // Of the joint that is farthest.
  static double Distance(const Candidate& a, const Candidate& b) {
    return (a.joints - b.joints).colwise().norm().maxCoeff();
  }

  const Eigen::VectorXd pose_;
  const Eigen::VectorXd relaxed_;
  const FrameProblem narrow_;
  const FrameProblem wide_;  // plain squares
  const Eigen::Matrix3d camera_from_ray_;
  FrameSolveOptions options_;
  KinematicState body_;
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

// A frame whose candidates are known, and for how many frames it stands.
struct PathFrame {
  int frame = 0;
  double weight = 1;
};

// Index of the chosen candidate of each sample.
std::vector<int> BestPath(const std::vector<PathFrame>& samples,
                          const std::vector<Candidates>& frames, double fps,
                          double evidence_weight) {
  std::vector<std::array<double, kNumCandidates>> cost(samples.size());
  std::vector<std::array<int, kNumCandidates>> from(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    const Candidates& here = frames[samples[i].frame];
    for (int c = 0; c < kNumCandidates; ++c) {
      double best = i == 0 ? 0 : std::numeric_limits<double>::infinity();
      from[i][c] = 0;
      for (int p = 0; i > 0 && p < kNumCandidates; ++p) {
        const double seconds = (samples[i].frame - samples[i - 1].frame) / fps;
        const double through =
            cost[i - 1][p] + TransitionCost(frames[samples[i - 1].frame][p], here[c], seconds);
        if (through < best) {
          best = through;
          from[i][c] = p;
        }
      }
      cost[i][c] = best + samples[i].weight * evidence_weight * here[c].cost;
    }
  }
  std::vector<int> path(samples.size());
  path.back() = static_cast<int>(std::min_element(cost.back().begin(), cost.back().end()) -
                                 cost.back().begin());
  for (size_t i = samples.size() - 1; i > 0; --i) path[i - 1] = from[i][path[i]];
  return path;
}

// The search over the frames of one run without gaps.
class RunSearch {
 public:
  RunSearch(const ClipEvidence& evidence, const FrameInitialization& initialization,
            const std::vector<Limb>& limbs, int begin, int end, Eigen::MatrixXd* poses)
      : evidence_(evidence),
        initialization_(initialization),
        limbs_(limbs),
        begin_(begin),
        end_(end),
        poses_(poses),
        candidates_(limbs.size(), std::vector<Candidates>(end - begin)),
        known_(end - begin, false) {}

  // Candidates are tried in every few frames, and in all frames near those that change by that.
  void Run() {
    const int num_frames = end_ - begin_;
    const int stride = std::max(1, static_cast<int>(evidence_.fps() * kSampleSeconds));
    std::vector<bool> wanted(num_frames, false);
    for (int i = 0; i < num_frames; i += stride) wanted[i] = true;
    wanted.back() = true;
    Eigen::ArrayXXi chosen = Choose(wanted);
    if (stride > 1) {
      for (int i = 0; i < num_frames; ++i) {
        const int first = std::max(0, i - stride);
        const int count = std::min(num_frames, i + stride + 1) - first;
        wanted[i] = wanted[i] || (chosen.middleCols(first, count) != 0).any();
      }
      chosen = Choose(wanted);
    }
    for (size_t l = 0; l < limbs_.size(); ++l) {
      for (int i = 0; i < num_frames; ++i) {
        const int c = chosen(static_cast<Eigen::Index>(l), i);
        if (c == 0) continue;  // as it is
        const Eigen::VectorXd& angles = candidates_[l][i][c].angles;
        for (size_t h = 0; h < limbs_[l].hinges.size(); ++h) {
          (*poses_)(6 + limbs_[l].hinges[h], begin_ + i) = angles[h];
        }
      }
    }
  }

 private:
  // The choice per limb and frame; 0 in frames that are not wanted.
  Eigen::ArrayXXi Choose(const std::vector<bool>& wanted) {
    const int num_frames = end_ - begin_;
    std::vector<PathFrame> samples;
    for (int i = 0; i < num_frames; ++i) {
      if (wanted[i]) samples.push_back({i, 1});
    }
    for (size_t i = 0; i < samples.size(); ++i) {
      const int before = i == 0 ? -1 : samples[i - 1].frame;
      const int after = i + 1 == samples.size() ? num_frames : samples[i + 1].frame;
      samples[i].weight = 0.5 * (after - before);
    }
    ParallelFor(static_cast<int>(samples.size()), evidence_.options().num_threads, [&](int i) {
      const int f = samples[i].frame;
      if (known_[f]) return;
      LimbFitter fit(evidence_, initialization_.observations[begin_ + f], poses_->col(begin_ + f));
      for (size_t l = 0; l < limbs_.size(); ++l) candidates_[l][f] = fit.Fit(limbs_[l]);
      known_[f] = true;
    });
    const double lasting_frames =
        kEvidenceSeconds * evidence_.fps() * (1 - evidence_.white_share());
    const double evidence_weight = 1 / std::max(1.0, lasting_frames) / kNoiseCost;
    Eigen::ArrayXXi chosen = Eigen::ArrayXXi::Zero(limbs_.size(), num_frames);
    for (size_t l = 0; l < limbs_.size(); ++l) {
      const std::vector<int> path =
          BestPath(samples, candidates_[l], evidence_.fps(), evidence_weight);
      for (size_t i = 0; i < samples.size(); ++i) {
        chosen(static_cast<Eigen::Index>(l), samples[i].frame) = path[i];
      }
    }
    return chosen;
  }

  const ClipEvidence& evidence_;
  const FrameInitialization& initialization_;
  const std::vector<Limb>& limbs_;
  int begin_;
  int end_;
  Eigen::MatrixXd* poses_;
  std::vector<std::vector<Candidates>> candidates_;  // per limb and frame
  std::vector<char> known_;                          // per frame
};

}  // namespace

void ChooseLimbs(const ClipEvidence& evidence, const FrameInitialization& initialization,
                 Eigen::MatrixXd* poses) {
  const int num_frames = static_cast<int>(poses->cols());
  const std::vector<Limb> limbs = MakeLimbs(evidence.skeleton());
  if (limbs.empty()) return;
  for (int begin = 0; begin < num_frames;) {
    int end = begin;
    while (end < num_frames && initialization.observed[end]) ++end;
    if (begin < end) RunSearch(evidence, initialization, limbs, begin, end, poses).Run();
    begin = end + 1;
  }
}

}  // namespace mpc
