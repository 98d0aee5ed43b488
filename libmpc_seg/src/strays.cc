#include "strays.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "colour_odds.h"
#include "picture.h"
#include "shape_odds.h"

namespace mpc {
namespace {

// In actor sizes.
constexpr double kThickBeyond = 0.04;  // half as thick
constexpr double kThickWithin = 0.05;
constexpr double kJoined = 0.03;

constexpr float kNoColour = 1.F / (1 << 24);  // density of any colour at all
constexpr uint8_t kMaxSpread = 20;            // a plate that varies more says too little
constexpr int kSurelySame = 200;  // squared colour steps: denser than that at any spread
constexpr float kMinCount = 2;    // of the actor in a bin
constexpr float kMinLearnt = 25;

// Colours in bins of 16 steps.
class Histogram {
 public:
  void Add(const cv::Vec3b& bgr) {
    ++bins_[Bin(bgr)];
    ++total_;
  }
  float total() const { return total_; }
  float operator[](const cv::Vec3b& bgr) const { return bins_[Bin(bgr)]; }

 private:
  static size_t Bin(const cv::Vec3b& c) {
    return static_cast<size_t>((c[0] >> 4) << 8 | (c[1] >> 4) << 4 | c[2] >> 4);
  }
  std::vector<float> bins_ = std::vector<float>(4096, 0.F);
  float total_ = 0;
};

bool LooksAs(const cv::Vec3b& bgr, const cv::Vec3b& plate, uint8_t spread) {
  const int b = bgr[0] - plate[0], g = bgr[1] - plate[1], r = bgr[2] - plate[2];
  return b * b + g * g + r * r < kSurelySame || PlateDensity(bgr, plate, spread) > kNoColour;
}

// 255 in the pieces of a mask that touch another one.
cv::Mat Touching(const cv::Mat& mask, const cv::Mat& other) {
  cv::Mat labels;
  const int n = cv::connectedComponents(mask | other, labels, 8, CV_32S);
  std::vector<uint8_t> touches(static_cast<size_t>(n), 0);
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (other.ptr(y)[x]) touches[static_cast<size_t>(labels.at<int>(y, x))] = 1;
    }
  }
  cv::Mat kept = mask.clone();
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) {
      if (!touches[static_cast<size_t>(labels.at<int>(y, x))]) kept.ptr(y)[x] = 0;
    }
  }
  return kept;
}

cv::Mat Pieces(const cv::Mat& mask, double radius) {
  cv::Mat closed;
  cv::morphologyEx(mask, closed, cv::MORPH_CLOSE, cv::Mat::ones(3, 3, CV_8U));
  return Thick(closed, radius);
}

// A mask of half the size at the whole one; empty if there is nothing.
cv::Mat Whole(const cv::Mat& mask, const cv::Size& size) {
  if (cv::countNonZero(mask) == 0) return {};
  cv::Mat whole(size, CV_8U, cv::Scalar(0));
  cv::Mat part = whole(cv::Rect({}, mask.size() * 2));
  cv::resize(mask, part, part.size(), 0, 0, cv::INTER_NEAREST);
  return whole;
}

}  // namespace

cv::Mat Thick(const cv::Mat& mask, double radius) {
  const int r = std::max(1, static_cast<int>(std::lround(radius)));
  // Mostly nothing: what a square inside of the disc tells for a tenth of the time.
  const int half_side = 7 * r / 10;
  cv::Mat thick;
  cv::erode(mask, thick, cv::Mat::ones(2 * half_side + 1, 2 * half_side + 1, CV_8U));
  if (cv::countNonZero(thick) == 0) return thick;
  cv::morphologyEx(mask, thick, cv::MORPH_OPEN,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * r + 1, 2 * r + 1}));
  return thick;
}

Strays FindStrays(const cv::Mat& bgr, const BackgroundPlate& plate, const cv::Mat& actor,
                  double core_px, double size_px) {
  if (std::min(actor.cols, actor.rows) < 2) return {};
  // Pieces that count are thick: half the size shows them in a quarter of the time.
  const cv::Mat near = Halved(actor) > 127, picture = Halved(bgr);
  const cv::Mat behind = Halved(plate.picture), spreads = Halved(plate.spread);
  const cv::Mat1f depth = Depth(near);
  const auto core = static_cast<float>(core_px / 2);
  const double half_size = size_px / 2;

  enum Look : uint8_t { kUnknown, kAsPlate, kOther };
  cv::Mat looks(near.size(), CV_8U, cv::Scalar(kUnknown));
  Histogram of_actor, of_others;
  for (int y = 0; y < near.rows; ++y) {
    const auto* colour = picture.ptr<cv::Vec3b>(y);
    const auto* known = behind.ptr<cv::Vec3b>(y);
    for (int x = 0; x < near.cols; ++x) {
      const uint8_t spread = spreads.ptr(y)[x];
      const bool is_known = spread <= kMaxSpread;
      const bool as_plate = is_known && LooksAs(colour[x], known[x], spread);
      if (is_known) looks.ptr(y)[x] = as_plate ? kAsPlate : kOther;
      if (near.ptr(y)[x] == 0) {
        if (as_plate) of_others.Add(colour[x]);
      } else if (!as_plate && depth(y, x) > core) {
        of_actor.Add(colour[x]);
      }
    }
  }
  if (std::min(of_actor.total(), of_others.total()) < kMinLearnt) return {};
  const float scale = of_others.total() / of_actor.total();
  cv::Mat beyond(near.size(), CV_8U, cv::Scalar(0)), within = beyond.clone();
  for (int y = 0; y < near.rows; ++y) {
    const auto* colour = picture.ptr<cv::Vec3b>(y);
    for (int x = 0; x < near.cols; ++x) {
      const uint8_t look = looks.ptr(y)[x];
      const bool inside = near.ptr(y)[x] != 0;
      if (look != (inside ? kAsPlate : kOther)) continue;
      const float count = of_actor[colour[x]];
      const bool of_actors = count >= kMinCount && count * scale > of_others[colour[x]];
      if (of_actors != inside) (inside ? within : beyond).ptr(y)[x] = 255;
    }
  }
  beyond = Pieces(beyond, kThickBeyond * half_size);
  if (cv::countNonZero(beyond) > 0) {
    const int r = std::max(1, static_cast<int>(std::lround(kJoined * half_size)));
    cv::Mat around;
    cv::dilate(near, around, cv::Mat::ones(2 * r + 1, 2 * r + 1, CV_8U));
    beyond = Touching(beyond, around);
  }
  return {Whole(beyond, actor.size()),
          Whole(Pieces(within, kThickWithin * half_size), actor.size())};
}

}  // namespace mpc
