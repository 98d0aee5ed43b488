#include "mpc/pose/standing_feet.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mpc {
namespace {

constexpr std::array kFootJoints = {JointId::kLeftAnkle, JointId::kRightAnkle, JointId::kLeftToe,
                                    JointId::kRightToe};
constexpr double kSpeed = 0.2;          // m/s across the ray that count as none
constexpr double kSpeedSeconds = 0.1;   // over which it is taken
constexpr double kLeastSeconds = 0.25;  // that a foot stands
constexpr double kReach = 0.05;         // m across the ray from where it began to stand

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How far b lies from a across the ray to a.
double Across(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (b - a).cross(a.normalized()).norm();
}

}  // namespace

void FindStandingFeet(const ClipEvidence& evidence, const Eigen::MatrixXd& poses,
                      std::vector<FrameObservation>* observations) {
  const Skeleton& skeleton = evidence.skeleton();
  const int num_frames = static_cast<int>(poses.cols());
  const double fps = evidence.fps();
  const int reach = std::max(1, static_cast<int>(std::lround(0.5 * kSpeedSeconds * fps)));
  const int least = std::max(3, static_cast<int>(std::lround(kLeastSeconds * fps)));
  std::array<Eigen::Matrix3Xd, kFootJoints.size()> tracks;
  std::array<int, kFootJoints.size()> joints{};
  for (size_t i = 0; i < kFootJoints.size(); ++i) {
    joints[i] = skeleton.FindJointIndex(kFootJoints[i]);
    tracks[i].resize(3, num_frames);
  }
  KinematicState state;
  for (int f = 0; f < num_frames; ++f) {
    (*observations)[f].standing.clear();
    ForwardKinematics(skeleton, poses.col(f), &state);
    for (size_t i = 0; i < joints.size(); ++i) {
      if (joints[i] >= 0) tracks[i].col(f) = state.joints.col(joints[i]);
    }
  }
  for (size_t i = 0; i < joints.size(); ++i) {
    if (joints[i] < 0) continue;
    const Eigen::Matrix3Xd& track = tracks[i];
    const auto stands = [&](int f) {
      const int before = std::max(0, f - reach);
      const int after = std::min(num_frames - 1, f + reach);
      const auto& points = (*observations)[f].points;
      const bool seen = std::any_of(points.begin(), points.end(), [&](const Observation2d& point) {
        return point.joint == joints[i];
      });
      return seen && Across(track.col(before), track.col(after)) * fps <= kSpeed * (after - before);
    };
    for (int begin = 0; begin < num_frames;) {
      int end = begin;
      while (end < num_frames && stands(end) && Across(track.col(begin), track.col(end)) <= kReach) {
        ++end;
      }
      if (end - begin >= least) {
        std::vector<double> ranges;
        for (int f = begin; f < end; ++f) ranges.push_back(track.col(f).norm());
        const double range_m = Median(std::move(ranges));
        for (int f = begin; f < end; ++f) {
          (*observations)[f].standing.push_back({joints[i], track.col(f).normalized(), range_m, 1});
        }
      }
      begin = std::max(begin + 1, end);
    }
  }
}

}  // namespace mpc
