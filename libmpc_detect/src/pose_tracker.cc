#include "mpc/detect/pose_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr double kMinTrackScore = 0.5;  // to go on following
constexpr double kMinNewScore = 0.8;    // to believe in a person
constexpr double kMinNewVisibility = 0.5;
constexpr double kMinLostVisibility = 0.4;
constexpr double kMinRegionPx = 8;
// In units of RegionDistance.
constexpr double kMaxJump = 0.45;      // from where a person was expected
constexpr double kMaxOffCenter = 0.1;  // of a person in the square that was looked at
constexpr double kSamePerson = 0.2;    // two regions
// Of a lost person: size relative to the last one, how long the motion goes on, squares to search.
constexpr double kMinLostSize = 0.5;
constexpr double kMaxLostSize = 1.6;
constexpr int kMaxLooks = 2;         // at a person who moved far, after the first
constexpr double kMaxGrowth = 0.45;  // of the logarithm of the size, looked at closely
constexpr double kMaxExtrapolationS = 0.4;
constexpr std::array kLostSquares = {1.5, 2.2};  // sides, in those of the region
constexpr double kLostGrowthPerS = 0.6;
// Bhattacharyya distance of colour histograms within which two people may be the same.
constexpr double kMaxColourDistance = 0.55;
constexpr double kColourUpdate = 0.1;

bool IsUsable(const PersonRegion& region) {
  return region.center.allFinite() && std::isfinite(region.size_px) &&
         std::isfinite(region.rotation_rad) && region.size_px >= kMinRegionPx;
}

// Mean confidence that elbows, wrists, knees and ankles are in view.
double LimbVisibility(const PersonPose& pose) {
  return (pose.visibility.segment<4>(13).sum() + pose.visibility.segment<4>(25).sum()) / 8;
}

// Hue and saturation of the person's pixels.
cv::Mat ColourHistogram(const cv::Mat& bgr, const PersonPose& pose) {
  constexpr int kSide = 64;
  cv::Mat hsv, mask;
  cv::cvtColor(CropRegion(bgr, pose.region, kSide), hsv, cv::COLOR_BGR2HSV);
  cv::resize(pose.mask, mask, {kSide, kSide}, 0, 0, cv::INTER_AREA);
  cv::Mat histogram;
  const float hue[] = {0, 180}, saturation[] = {0, 256}, value[] = {0, 256};
  const float* ranges[] = {hue, saturation, value};
  const int channels[] = {0, 1, 2}, sizes[] = {12, 4, 4};
  cv::calcHist(&hsv, 1, channels, mask > 0.5, histogram, 3, sizes, ranges);
  histogram /= std::max(1.0, cv::sum(histogram)[0]);
  return histogram;
}

double ColourDistance(const cv::Mat& a, const cv::Mat& b) {
  return cv::compareHist(a.reshape(1, 1), b.reshape(1, 1), cv::HISTCMP_BHATTACHARYYA);
}

cv::Rect SquareAround(const Eigen::Vector2d& center, double side) {
  return {static_cast<int>(std::lround(center.x() - side / 2)),
          static_cast<int>(std::lround(center.y() - side / 2)), static_cast<int>(std::lround(side)),
          static_cast<int>(std::lround(side))};
}

}  // namespace

PoseTracker::PoseTracker(PersonDetector detector, PoseLandmarker landmarker, double fps,
                         PoseTrackerOptions options)
    : detector_(std::move(detector)),
      landmarker_(std::move(landmarker)),
      fps_(fps),
      options_(options) {
  if (!(fps > 0) || options.max_persons < 1) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("fps is {} and max_persons {}, expected above 0 and at least 1", fps,
                            options.max_persons));
  }
}

bool PoseTracker::IsTaken(const PersonRegion& region) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [&](const Track& track) {
    return track.pose && RegionDistance(track.pose->refined, region) < kSamePerson;
  });
}

// Who is not in this frame as yet and has colours near these: the nearest, or nobody.
PoseTracker::Track* PoseTracker::MostSimilar(const cv::Mat& colours) {
  Track* nearest = nullptr;
  double best = kMaxColourDistance;
  for (Track& track : tracks_) {
    if (track.pose) continue;
    const double distance = ColourDistance(colours, track.colours);
    if (distance >= best) continue;
    best = distance;
    nearest = &track;
  }
  return nearest;
}

// Looks twice, the second time where the first look says, and wants a whole person both times.
std::optional<PersonPose> PoseTracker::Verify(const cv::Mat& bgr, const PersonRegion& region,
                                              double min_visibility) {
  PersonPose pose = landmarker_.Find(bgr, region);
  for (const bool again : {true, false}) {
    if (pose.score < kMinNewScore || LimbVisibility(pose) < min_visibility ||
        !IsUsable(pose.refined)) {
      return std::nullopt;
    }
    if (again) pose = landmarker_.Find(bgr, pose.refined);
  }
  return pose;
}

std::optional<PersonPose> PoseTracker::FindExpected(const cv::Mat& bgr,
                                                    const PersonRegion& expected) {
  PersonPose pose = landmarker_.Find(bgr, expected);
  const auto is_person = [&pose] { return pose.score >= kMinTrackScore && IsUsable(pose.refined); };
  // A person near the square's border is seen badly: another look, from where this one says.
  for (int look = 0; look < kMaxLooks && is_person(); ++look) {
    if (RegionDistance(pose.refined, pose.region) < kMaxOffCenter) break;
    pose = landmarker_.Find(bgr, pose.refined);
  }
  if (!is_person() || RegionDistance(pose.refined, expected) > kMaxJump) return std::nullopt;
  return pose;
}

// Two tracks on one person: who was expected there keeps it.
void PoseTracker::Separate() {
  const auto surprise = [](const Track& track) {
    return RegionDistance(track.pose->refined, track.predicted);
  };
  for (Track& a : tracks_) {
    for (Track& b : tracks_) {
      if (&a == &b || !a.pose || !b.pose) continue;
      if (RegionDistance(a.pose->refined, b.pose->refined) >= kSamePerson) continue;
      (surprise(a) > surprise(b) ? a : b).pose.reset();
    }
  }
}

// Of all who are found around the expected place: who has the most similar colours and size.
void PoseTracker::SearchLost(const cv::Mat& bgr, Track* track) {
  const double lost_s = (frame_ - track->seen) / fps_;
  const PersonRegion& expected = track->predicted;
  std::vector<PersonCandidate> candidates;
  for (const double square : kLostSquares) {
    const double side = square * (1 + kLostGrowthPerS * lost_s) * expected.size_px;
    for (const PersonCandidate& candidate :
         detector_.Find(bgr, SquareAround(expected.center, side))) {
      const bool is_known =
          std::any_of(candidates.begin(), candidates.end(), [&](const PersonCandidate& other) {
            return RegionDistance(candidate.region, other.region) < kSamePerson;
          });
      if (!is_known) candidates.push_back(candidate);
    }
  }
  std::optional<PersonPose> found;
  double best = std::numeric_limits<double>::infinity();
  for (const PersonCandidate& candidate : candidates) {
    const double ratio = candidate.region.size_px / expected.size_px;
    if (ratio < kMinLostSize || ratio > kMaxLostSize || IsTaken(candidate.region)) continue;
    std::optional<PersonPose> pose = Verify(bgr, candidate.region, kMinLostVisibility);
    if (!pose || IsTaken(pose->refined)) continue;
    const double growth = std::abs(std::log(pose->refined.size_px / expected.size_px));
    const cv::Mat colours = ColourHistogram(bgr, *pose);
    const double difference = ColourDistance(colours, track->colours) + growth;
    if (growth > kMaxGrowth || MostSimilar(colours) != track || difference >= best) continue;
    best = difference;
    found = std::move(pose);
  }
  track->pose = std::move(found);
}

void PoseTracker::SearchNew(const cv::Mat& bgr, bool everywhere) {
  const std::vector<PersonCandidate> candidates =
      everywhere ? detector_.FindEverywhere(bgr) : detector_.Find(bgr, {0, 0, bgr.cols, bgr.rows});
  for (const PersonCandidate& candidate : candidates) {
    if (IsTaken(candidate.region)) continue;
    std::optional<PersonPose> pose = Verify(bgr, candidate.region, kMinNewVisibility);
    if (!pose || IsTaken(pose->refined)) continue;
    const cv::Mat colours = ColourHistogram(bgr, *pose);
    Track* known = MostSimilar(colours);
    if (known == nullptr) {
      const auto followed = std::count_if(tracks_.begin(), tracks_.end(), [](const Track& track) {
        return track.pose.has_value();
      });
      if (followed >= options_.max_persons) return;
      known = &tracks_.emplace_back();
      known->id = next_id_++;
      known->colours = colours;
      known->seen = frame_;
      known->predicted = pose->refined;
    }
    known->velocity.setZero();
    known->turn_rad = 0;
    known->pose = std::move(pose);
  }
}

void PoseTracker::Accept(const cv::Mat& bgr, int frame, Track* track) {
  const PersonRegion& now = track->pose->refined;
  const int elapsed = frame - track->seen;
  if (elapsed > 0 && elapsed <= kMaxExtrapolationS * fps_) {
    const Eigen::Vector2d velocity = (now.center - track->region.center) / elapsed;
    track->velocity = (track->velocity + velocity) / 2;
    track->turn_rad =
        std::remainder(now.rotation_rad - track->region.rotation_rad, 2 * std::numbers::pi) /
        elapsed;
  }
  track->region = now;
  track->seen = frame;
  track->colours =
      (1 - kColourUpdate) * track->colours + kColourUpdate * ColourHistogram(bgr, *track->pose);
}

std::vector<TrackedPerson> PoseTracker::Next(const cv::Mat& bgr, int frame) {
  if (frame <= frame_) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("frame {} follows frame {}", frame, frame_));
  }
  const int previous = std::exchange(frame_, frame);
  for (Track& track : tracks_) {
    // The region is where to look in the next frame; the motion says where in later ones.
    const double ahead = std::clamp<double>(frame - track.seen - 1, 0, kMaxExtrapolationS * fps_);
    track.predicted = track.region;
    track.predicted.center += ahead * track.velocity;
    track.predicted.rotation_rad += ahead * track.turn_rad;
    track.pose.reset();
    if (track.seen == previous) track.pose = FindExpected(bgr, track.predicted);
  }
  Separate();
  for (Track& track : tracks_) {
    if (!track.pose && frame - track.seen <= options_.give_up_s * fps_) SearchLost(bgr, &track);
  }
  const bool nobody = std::none_of(tracks_.begin(), tracks_.end(),
                                   [](const Track& track) { return track.pose.has_value(); });
  if (nobody || frame >= next_search_) {
    const bool everywhere = nobody || frame >= next_far_search_;
    SearchNew(bgr, everywhere);
    next_search_ = frame + static_cast<int>(std::ceil(options_.search_s * fps_));
    if (everywhere) {
      next_far_search_ = frame + static_cast<int>(std::ceil(options_.search_far_s * fps_));
    }
  }
  std::vector<TrackedPerson> persons;
  for (Track& track : tracks_) {
    if (!track.pose) continue;
    Accept(bgr, frame, &track);
    persons.push_back({track.id, *std::move(track.pose)});
  }
  return persons;
}

}  // namespace mpc
