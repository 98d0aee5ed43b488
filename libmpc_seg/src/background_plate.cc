#include "mpc/seg/background_plate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/seg/mask_bounds.h"
#include "mpc/seg/trimap.h"
#include "picture.h"

namespace mpc {
namespace {

// Distances from M, in actor sizes.
constexpr double kFar =
    0.2;  // wider than the band in which the actor may be, since skirts swing out of it
constexpr double kNear = 0.03;  // a pose that is right to a few centimetres
constexpr int kMinFar = 3;
constexpr int kMinNear = 5;
constexpr size_t kMaxSamples = 255;
constexpr int kStripRows = 16;     // that share their buffers
constexpr int kMaxNearSpread = 8;  // near the actor only what never changes is background
constexpr double kMadToSigma = 1.4826;

enum Place : uint8_t { kActor, kNearActor, kFarFromActor };

cv::Mat PlacesOf(const cv::Mat& model_mask) {
  cv::Mat places(model_mask.size(), CV_8U, cv::Scalar(kFarFromActor));
  const cv::Rect box = MaskBounds(model_mask);
  if (box.empty()) return places;
  const double size = ActorSizePx(model_mask);
  const cv::Rect around = Grown(box, static_cast<int>(kFar * size) + 2, model_mask.size());
  cv::Mat1f distance;
  cv::distanceTransform(model_mask(around) == 0, distance, cv::DIST_L2, cv::DIST_MASK_5);
  places(around) = (distance > kNear * size) / 255 + (distance > kFar * size) / 255;
  return places;
}

// Some rows of the plate as a sample shows them; 0 where it does not.
cv::Mat StripOf(const cv::Mat& picture, const std::optional<cv::Matx33d>& plate_from_picture,
                const cv::Range& rows, int width, int interpolation) {
  if (!plate_from_picture) return picture.rowRange(rows);
  const cv::Matx33d up(1, 0, 0, 0, 1, -rows.start, 0, 0, 1);
  cv::Mat strip;
  cv::warpPerspective(picture, strip, up * *plate_from_picture, {width, rows.size()},
                      interpolation);
  return strip;
}

// One row of every sample, all channels side by side, so that many are looked at in one instruction.
struct SampleRows {
  SampleRows(int num_samples, int width)
      : unseen(num_samples, width), values(num_samples, width), count(1, width), spread(1, width) {}

  cv::Mat1b unseen;  // a row per sample: 0 where the background is, else 255
  cv::Mat1b values;  // 255 where the background is not
  cv::Mat1b count;   // of samples in which it is
  cv::Mat1b spread;
};

// Pixel by pixel the median of the values seen (the upper one of two), bit by bit. 255 is below
// nothing, so that what is not seen does not count.
void Median(const SampleRows& rows, uint8_t* median) {
  const int width = rows.count.cols;
  cv::Mat1b trial(1, width), num_below(1, width);
  uint8_t* const least = trial.ptr();
  uint8_t* const below = num_below.ptr();
  const uint8_t* const count = rows.count.ptr();
  std::fill_n(median, width, uint8_t{0});
  for (int bit = 128; bit > 0; bit /= 2) {
    for (int x = 0; x < width; ++x) least[x] = static_cast<uint8_t>(median[x] | bit);
    std::fill_n(below, width, uint8_t{0});
    for (int s = 0; s < rows.values.rows; ++s) {
      const uint8_t* const value = rows.values[s];
      for (int x = 0; x < width; ++x) {
        below[x] = static_cast<uint8_t>(below[x] + static_cast<int>(value[x] < least[x]));
      }
    }
    for (int x = 0; x < width; ++x) median[x] = below[x] <= count[x] / 2 ? least[x] : median[x];
  }
}

}  // namespace

BackgroundPlate MakeBackgroundPlate(std::span<const PlateSample> samples, int num_threads,
                                    const cv::Size& plate_size) {
  if (samples.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "background plate: no samples, expected at least one");
  }
  if (samples.size() > kMaxSamples) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("background plate: {} samples, expected at most {}", samples.size(),
                            kMaxSamples));
  }
  const cv::Size picture_size = samples.front().picture.size();
  const cv::Size size = plate_size.empty() ? picture_size : plate_size;
  std::vector<cv::Mat> pictures(samples.size()), places(samples.size());
  for (const PlateSample& sample : samples) {
    CheckPicture(sample.picture, "sample of the background");
    CheckMask(sample.model_mask, sample.picture.size(), "model mask");
    if (sample.picture.size() != picture_size) {
      throw Error(ErrorCode::kMismatch, "background plate: the samples have different sizes");
    }
    if (!sample.plate_from_picture && size != picture_size) {
      throw Error(ErrorCode::kMismatch, "background plate: a sample has no place on it");
    }
  }
  ParallelFor(static_cast<int>(samples.size()), num_threads, [&](int i) {
    const auto s = static_cast<size_t>(i);
    pictures[s] = ToBgr8(samples[s].picture);
    places[s] = PlacesOf(samples[s].model_mask);
    // What is blended with what lies outside of the picture is not seen.
    if (samples[s].plate_from_picture) {
      cv::rectangle(places[s], {{}, picture_size}, cv::Scalar(kActor));
    }
  });

  BackgroundPlate plate;
  plate.picture = cv::Mat(size, CV_8UC3, cv::Scalar::all(0));
  plate.spread = cv::Mat(size, CV_8U, cv::Scalar(BackgroundPlate::kUnknown));
  const auto num_samples = static_cast<int>(samples.size());
  // One row of the plate, of strips of all samples in which it is the given one.
  const auto see_row = [&](int y, int row, const std::vector<cv::Mat>& seen_pictures,
                           const std::vector<cv::Mat>& seen_places, SampleRows& rows) {
    const int width = size.width;
    std::vector<int> num_far(static_cast<size_t>(width), 0);
    for (const cv::Mat& place : seen_places) {
      const uint8_t* at = place.ptr(row);
      for (int x = 0; x < width; ++x) num_far[static_cast<size_t>(x)] += at[x] == kFarFromActor;
    }
    rows.count.setTo(0);
    uint8_t* const count = rows.count.ptr();
    for (int s = 0; s < num_samples; ++s) {
      const uint8_t* place = seen_places[static_cast<size_t>(s)].ptr(row);
      const uint8_t* bgr = seen_pictures[static_cast<size_t>(s)].ptr(row);
      uint8_t* const unseen = rows.unseen[s];
      uint8_t* const values = rows.values[s];
      for (int x = 0; x < width; ++x) {
        const bool far = num_far[static_cast<size_t>(x)] >= kMinFar;
        const bool seen = place[x] >= (far ? kFarFromActor : kNearActor);
        std::fill_n(&unseen[3 * x], 3, static_cast<uint8_t>(seen ? 0 : 255));
      }
      for (int i = 0; i < 3 * width; ++i) {
        count[i] = static_cast<uint8_t>(count[i] + static_cast<int>(unseen[i] == 0));
        values[i] = bgr[i] | unseen[i];
      }
    }
    uint8_t* const median = plate.picture.ptr(y);
    Median(rows, median);
    for (int s = 0; s < num_samples; ++s) {
      uint8_t* const values = rows.values[s];
      const uint8_t* const unseen = rows.unseen[s];
      for (int i = 0; i < 3 * width; ++i) {
        const int off = values[i] > median[i] ? values[i] - median[i] : median[i] - values[i];
        values[i] = static_cast<uint8_t>(off | unseen[i]);
      }
    }
    Median(rows, rows.spread.ptr());
    for (int x = 0; x < width; ++x) {
      const bool far = num_far[static_cast<size_t>(x)] >= kMinFar;
      if (!far && count[3 * x] < kMinNear) {
        plate.picture.ptr<cv::Vec3b>(y)[x] = {};
        continue;
      }
      const uint8_t* const of = &rows.spread.ptr()[3 * x];
      const double sigma =
          std::min(kMadToSigma * std::max({of[0], of[1], of[2]}), BackgroundPlate::kUnknown - 1.0);
      if (far || sigma < kMaxNearSpread + 1) plate.spread.ptr(y)[x] = static_cast<uint8_t>(sigma);
    }
  };
  ParallelFor((size.height + kStripRows - 1) / kStripRows, num_threads, [&](int strip) {
    SampleRows rows(num_samples, 3 * size.width);
    const cv::Range range(strip * kStripRows, std::min((strip + 1) * kStripRows, size.height));
    std::vector<cv::Mat> seen_pictures, seen_places;
    for (size_t s = 0; s < samples.size(); ++s) {
      const std::optional<cv::Matx33d>& place = samples[s].plate_from_picture;
      seen_pictures.push_back(StripOf(pictures[s], place, range, size.width, cv::INTER_LINEAR));
      seen_places.push_back(StripOf(places[s], place, range, size.width, cv::INTER_NEAREST));
    }
    for (int y = range.start; y < range.end; ++y) {
      see_row(y, y - range.start, seen_pictures, seen_places, rows);
    }
  });
  return plate;
}

BackgroundPlate ViewOfPlate(const BackgroundPlate& plate, const cv::Matx33d& plate_from_picture,
                            const cv::Size& size) {
  BackgroundPlate view;
  constexpr int kFlags = cv::INTER_LINEAR | cv::WARP_INVERSE_MAP;
  cv::warpPerspective(plate.picture, view.picture, plate_from_picture, size, kFlags);
  cv::warpPerspective(plate.spread, view.spread, plate_from_picture, size, kFlags,
                      cv::BORDER_CONSTANT, cv::Scalar(BackgroundPlate::kUnknown));
  return view;
}

}  // namespace mpc
