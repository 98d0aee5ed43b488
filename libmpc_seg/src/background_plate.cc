#include "mpc/seg/background_plate.h"

#include <fmt/format.h>

#include <algorithm>
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
constexpr double kFar = 0.2;    // wider than the band in which the actor may be, since skirts swing out of it
constexpr double kNear = 0.03;  // a pose that is right to a few centimetres
constexpr int kMinFar = 3;
constexpr int kMinNear = 5;
constexpr size_t kMaxSamples = 255;
constexpr int kMaxNearSpread = 8;  // near the actor only what never changes is background
constexpr double kMadToSigma = 1.4826;

enum Place : uint8_t { kActor, kNearActor, kFarFromActor };

cv::Mat PlacesOf(const cv::Mat& model_mask) {
  cv::Mat places(model_mask.size(), CV_8U, cv::Scalar(kFarFromActor));
  cv::Rect around = cv::boundingRect(model_mask);
  if (around.empty()) return places;
  const double size = ActorSizePx(model_mask);
  const int margin = static_cast<int>(kFar * size) + 2;
  around = (around - cv::Point(margin, margin) + cv::Size(2 * margin, 2 * margin)) &
           cv::Rect({}, model_mask.size());
  cv::Mat1f distance;
  cv::distanceTransform(model_mask(around) == 0, distance, cv::DIST_L2, cv::DIST_MASK_5);
  places(around) = (distance > kNear * size) / 255 + (distance > kFar * size) / 255;
  return places;
}

// One row of every sample, so that many pixels are looked at in one instruction.
struct SampleRows {
  SampleRows(size_t num_samples, int width)
      : seen(num_samples, std::vector<uint8_t>(static_cast<size_t>(width))),
        values(seen),
        count(static_cast<size_t>(width)) {}

  std::vector<std::vector<uint8_t>> seen;    // 1 where the background is
  std::vector<std::vector<uint8_t>> values;  // one channel
  std::vector<uint8_t> count;                // of samples in which it is
};

// below += seen where value < least.
void CountBelow(size_t width, const uint8_t* value, const uint8_t* seen, const uint8_t* least,
                uint8_t* below) {
  for (size_t x = 0; x < width; ++x) {
    const auto mask = static_cast<uint8_t>(-static_cast<int>(value[x] < least[x]));
    below[x] = static_cast<uint8_t>(below[x] + (seen[x] & mask));
  }
}

// Pixel by pixel the median of the values seen (the upper one of two), bit by bit.
void Median(const SampleRows& rows, std::vector<uint8_t>* median) {
  const size_t width = rows.count.size();
  median->assign(width, 0);
  std::vector<uint8_t> least(width), below(width);
  for (int bit = 128; bit > 0; bit /= 2) {
    below.assign(width, 0);
    for (size_t x = 0; x < width; ++x) least[x] = static_cast<uint8_t>((*median)[x] | bit);
    for (size_t s = 0; s < rows.values.size(); ++s) {
      CountBelow(width, rows.values[s].data(), rows.seen[s].data(), least.data(), below.data());
    }
    for (size_t x = 0; x < width; ++x) {
      if (below[x] <= rows.count[x] / 2) (*median)[x] = least[x];
    }
  }
}

}  // namespace

BackgroundPlate MakeBackgroundPlate(std::span<const PlateSample> samples, int num_threads) {
  if (samples.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "background plate: no samples, expected at least one");
  }
  if (samples.size() > kMaxSamples) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("background plate: {} samples, expected at most {}", samples.size(),
                            kMaxSamples));
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
    const auto width = static_cast<size_t>(size.width);
    SampleRows rows(pictures.size(), size.width);
    std::vector<uint8_t> num_far(width, 0), median(width), spread(width), largest(width, 0);
    for (const cv::Mat& place : places) {
      for (size_t x = 0; x < width; ++x) {
        num_far[x] += static_cast<uint8_t>(place.ptr(y)[x] == kFarFromActor);
      }
    }
    for (size_t s = 0; s < places.size(); ++s) {
      const uint8_t* place = places[s].ptr(y);
      for (size_t x = 0; x < width; ++x) {
        rows.seen[s][x] = place[x] >= (num_far[x] >= kMinFar ? kFarFromActor : kNearActor) ? 1 : 0;
        rows.count[x] += rows.seen[s][x];
      }
    }
    for (int c = 0; c < 3; ++c) {
      for (size_t s = 0; s < pictures.size(); ++s) {
        const auto* bgr = pictures[s].ptr<cv::Vec3b>(y);
        for (size_t x = 0; x < width; ++x) rows.values[s][x] = bgr[x][c];
      }
      Median(rows, &median);
      for (std::vector<uint8_t>& values : rows.values) {
        for (size_t x = 0; x < width; ++x) {
          values[x] = static_cast<uint8_t>(std::abs(values[x] - median[x]));
        }
      }
      Median(rows, &spread);
      for (size_t x = 0; x < width; ++x) {
        plate.picture.ptr<cv::Vec3b>(y)[x][c] = median[x];
        largest[x] = std::max(largest[x], spread[x]);
      }
    }
    for (size_t x = 0; x < width; ++x) {
      const bool is_far = num_far[x] >= kMinFar;
      if (!is_far && rows.count[x] < kMinNear) {
        plate.picture.ptr<cv::Vec3b>(y)[x] = {};
        continue;
      }
      const double sigma = std::min(kMadToSigma * largest[x], BackgroundPlate::kUnknown - 1.0);
      if (is_far || sigma < kMaxNearSpread + 1)
        plate.spread.ptr(y)[x] = static_cast<uint8_t>(sigma);
    }
  });
  return plate;
}

}  // namespace mpc
