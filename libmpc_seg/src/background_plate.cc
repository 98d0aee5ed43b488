#include "mpc/seg/background_plate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/seg/trimap.h"
#include "picture.h"

namespace mpc {
namespace {

// Distances from M, in actor sizes.
constexpr double kFar = 0.13;   // as wide as the band in which the actor may be
constexpr double kNear = 0.03;  // a pose that is right to a few centimetres
constexpr size_t kMinFar = 3;
constexpr size_t kMinNear = 5;
constexpr int kMaxNearSpread = 8;  // near the actor only what never changes is background
constexpr double kMadToSigma = 1.4826;

enum Place : uint8_t { kActor, kNearActor, kFarFromActor };

cv::Mat PlacesOf(const cv::Mat& model_mask) {
  cv::Mat1f distance;
  cv::distanceTransform(model_mask == 0, distance, cv::DIST_L2, cv::DIST_MASK_5);
  const double size = ActorSizePx(model_mask);
  cv::Mat places = (distance > kNear * size) / 255 + (distance > kFar * size) / 255;
  if (size == 0) places.setTo(kFarFromActor);
  return places;
}

uint8_t Median(std::span<uint8_t> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Median colour, and the largest spread of a channel around it.
int SummariseColours(std::span<const cv::Vec3b> colours, std::vector<uint8_t>* scratch,
                     cv::Vec3b* median) {
  double spread = 0;
  for (int c = 0; c < 3; ++c) {
    scratch->clear();
    for (const cv::Vec3b& colour : colours) scratch->push_back(colour[c]);
    (*median)[c] = Median(*scratch);
    for (uint8_t& value : *scratch) {
      value = static_cast<uint8_t>(std::abs(value - (*median)[c]));
    }
    spread = std::max(spread, kMadToSigma * Median(*scratch));
  }
  return static_cast<int>(std::min(spread, BackgroundPlate::kUnknown - 1.0));
}

}  // namespace

BackgroundPlate MakeBackgroundPlate(std::span<const PlateSample> samples, int num_threads) {
  if (samples.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "background plate: no samples, expected at least one");
  }
  const cv::Size size = samples.front().picture.size();
  std::vector<cv::Mat> pictures(samples.size()), places(samples.size());
  for (const PlateSample& sample : samples) {
    CheckPicture(sample.picture, "sample of the background");
    CheckMask(sample.model_mask, sample.picture.size(), "model mask");
    if (sample.picture.size() != size) {
      throw Error(ErrorCode::kMismatch, "background plate: the samples have different sizes");
    }
  }
  ParallelFor(static_cast<int>(samples.size()), num_threads, [&](int i) {
    const auto s = static_cast<size_t>(i);
    pictures[s] = ToBgr8(samples[s].picture);
    places[s] = PlacesOf(samples[s].model_mask);
  });

  BackgroundPlate plate;
  plate.picture = cv::Mat(size, CV_8UC3, cv::Scalar::all(0));
  plate.spread = cv::Mat(size, CV_8U, cv::Scalar(BackgroundPlate::kUnknown));
  ParallelFor(size.height, num_threads, [&](int y) {
    std::array<std::vector<cv::Vec3b>, 3> colours;  // per Place
    std::vector<uint8_t> scratch;
    for (int x = 0; x < size.width; ++x) {
      for (std::vector<cv::Vec3b>& list : colours) list.clear();
      for (size_t s = 0; s < pictures.size(); ++s) {
        colours[places[s].ptr(y)[x]].push_back(pictures[s].ptr<cv::Vec3b>(y)[x]);
      }
      const bool is_far = colours[kFarFromActor].size() >= kMinFar;
      std::vector<cv::Vec3b>& seen = colours[is_far ? kFarFromActor : kNearActor];
      if (!is_far) {
        seen.insert(seen.end(), colours[kFarFromActor].begin(), colours[kFarFromActor].end());
        if (seen.size() < kMinNear) continue;
      }
      const int spread = SummariseColours(seen, &scratch, &plate.picture.ptr<cv::Vec3b>(y)[x]);
      if (is_far || spread <= kMaxNearSpread) {
        plate.spread.ptr(y)[x] = static_cast<uint8_t>(spread);
      }
    }
  });
  return plate;
}

}  // namespace mpc
