#include "mpc/deform/refinement_smoother.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "mpc/skeleton/skinning.h"

namespace mpc {
namespace {

constexpr int kMaxDepthReach = 16;  // frames: whoever waits for them may hold their pictures
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Where the joints of the paper are on average.
Eigen::Vector3d Centre(const Skeleton& skeleton, const KinematicState& state) {
  return state.joints.leftCols(std::min(kNumPaperJoints, skeleton.num_joints())).rowwise().mean();
}

Eigen::Vector3d Centre(const Skeleton& skeleton, const Eigen::VectorXd& pose) {
  KinematicState state;
  ForwardKinematics(skeleton, pose, &state);
  return Centre(skeleton, state);
}

}  // namespace

RefinementSmoother::RefinementSmoother(const Character& character, double fps,
                                       const SmoothingOptions& options)
    : character_(&character),
      options_(options),
      depth_reach_(static_cast<int>(
          std::lround(std::min<double>(kMaxDepthReach, fps * options.depth_seconds)))) {
  options.Validate();
}

void RefinementSmoother::Push(const Eigen::VectorXd& batch_pose, FrameRefinement frame) {
  Entry entry = {batch_pose, std::move(frame), Eigen::Vector3d::Zero(), kUnknown, 0};
  if (depth_reach_ > 0 && entry.refinement.pose_state == RefinementState::kRefined) {
    entry.centre = Centre(character_->skeleton, entry.refinement.pose);
    const Eigen::Vector3d moved = entry.centre - Centre(character_->skeleton, batch_pose);
    entry.depth = entry.centre.normalized().dot(moved);
  }
  window_.push_back(std::move(entry));
}

// Of the next frame, along the ray to its actor.
void RefinementSmoother::SmoothDepth() {
  Entry& middle = window_[static_cast<size_t>(depth_next_ - first_)];
  const int begin = depth_next_ - depth_reach_;
  ++depth_next_;
  if (std::isnan(middle.depth)) return;
  Eigen::VectorXd depths(2 * depth_reach_ + 1);
  for (int i = 0; i < depths.size(); ++i) {
    depths[i] = begin + i < 0 || begin + i >= end() ? kUnknown : entry(begin + i).depth;
  }
  middle.shift = SmoothedMiddle(depths) - middle.depth;
  middle.refinement.pose.head<3>() += middle.shift * middle.centre.normalized();
}

bool RefinementSmoother::Pop(SmoothedFrame* frame) {
  while (depth_next_ < end() && (ended_ || depth_next_ + depth_reach_ < end())) SmoothDepth();
  const int half = options_.window_frames / 2;
  // Poses of frames that were not refined are filled from windows of their own.
  const int reach = 2 * half;
  const bool last = ended_ && depth_next_ == end();
  if (next_ >= depth_next_ || (!last && next_ + reach >= depth_next_)) return false;

  const int begin = std::max(next_ - reach, 0);
  const int count = std::min(next_ + reach + 1, depth_next_) - begin;
  const Eigen::Index num_dofs = entry(next_).batch_pose.size();
  Eigen::MatrixXd batch(num_dofs, count);
  Eigen::MatrixXd refined(num_dofs, count);
  std::vector<bool> is_refined;
  for (int i = 0; i < count; ++i) {
    batch.col(i) = entry(begin + i).batch_pose;
    refined.col(i) = entry(begin + i).refinement.pose;
    is_refined.push_back(entry(begin + i).refinement.pose_state == RefinementState::kRefined);
  }
  frame->pose =
      SmoothPoses(character_->skeleton, batch, refined, is_refined, options_).col(next_ - begin);
  KinematicState state;
  ForwardKinematics(character_->skeleton, frame->pose, &state);
  SkinCharacter(*character_, state, &frame->vertices);

  std::vector<Eigen::Matrix3Xf> displacements(static_cast<size_t>(options_.window_frames));
  std::vector<bool> usable(displacements.size(), false);
  Eigen::VectorXd shifts = Eigen::VectorXd::Zero(options_.window_frames);
  for (int f = std::max(next_ - half, 0); f < std::min(next_ + half + 1, depth_next_); ++f) {
    const int i = f - (next_ - half);
    displacements[static_cast<size_t>(i)] = entry(f).refinement.displacements;
    usable[static_cast<size_t>(i)] = entry(f).refinement.displacements.size() > 0;
    shifts[i] = entry(f).shift;
  }
  Eigen::Matrix3Xf smoothed = SmoothDisplacements(displacements, options_);
  if (smoothed.size() > 0) {
    TurnFromBind(*character_, state, &smoothed);
    frame->vertices += smoothed;
    // What was fitted to the outline nearer or farther away keeps its size in the picture.
    const Eigen::Vector3d centre = Centre(character_->skeleton, state);
    const double shift = SmoothingWeights(usable, options_).dot(shifts);
    const float scale = static_cast<float>(1 + shift / centre.norm());
    const Eigen::Vector3f middle = centre.cast<float>();
    frame->vertices = (scale * (frame->vertices.colwise() - middle)).colwise() + middle;
    const FrameRefinement& refinement = entry(next_).refinement;
    if (options_.keep_m > 0 && refinement.surface.size() > 0) {
      KeepSeen(refinement.surface, refinement.evidence, options_.keep_m, &frame->vertices);
    }
  }
  ++next_;
  while (first_ < std::min(next_ - reach, depth_next_ - depth_reach_)) {
    window_.pop_front();
    ++first_;
  }
  return true;
}

}  // namespace mpc
