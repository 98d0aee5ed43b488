#include "mpc/deform/refinement_smoother.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "mpc/skeleton/skinning.h"

namespace mpc {

RefinementSmoother::RefinementSmoother(const Character& character, const SmoothingOptions& options)
    : character_(&character), options_(options) {
  options.Validate();
}

void RefinementSmoother::Push(const Eigen::VectorXd& batch_pose, FrameRefinement frame) {
  window_.push_back({batch_pose, std::move(frame)});
}

bool RefinementSmoother::Pop(SmoothedFrame* frame) {
  const int half = options_.window_frames / 2;
  // Poses of frames that were not refined are filled from windows of their own.
  const int reach = 2 * half;
  const int end = first_ + static_cast<int>(window_.size());  // of what was pushed
  if (next_ >= end || (!ended_ && next_ + reach >= end)) return false;
  const auto entry = [&](int f) -> const Entry& {
    return window_[static_cast<size_t>(f - first_)];
  };

  const int begin = std::max(next_ - reach, 0);
  const int count = std::min(next_ + reach + 1, end) - begin;
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
  for (int f = std::max(next_ - half, 0); f < std::min(next_ + half + 1, end); ++f) {
    displacements[static_cast<size_t>(f - (next_ - half))] = entry(f).refinement.displacements;
  }
  Eigen::Matrix3Xf smoothed = SmoothDisplacements(displacements, options_);
  if (smoothed.size() > 0) {
    TurnFromBind(*character_, state, &smoothed);
    frame->vertices += smoothed;
  }
  ++next_;
  while (first_ < next_ - reach) {
    window_.pop_front();
    ++first_;
  }
  return true;
}

}  // namespace mpc
