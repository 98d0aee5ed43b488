#include "mpc/detect/person_detector.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/dnn.hpp>
#include <utility>

#include "mpc/core/error.h"
#include "warp.h"

namespace mpc {
namespace {

constexpr int kDetectorInput = 224;
constexpr double kMinPersonScore = 0.5;
constexpr double kSamePersonIou = 0.3;
constexpr double kTileShare = 0.75;  // of the picture's shorter side
// In units of RegionDistance: nearer candidates are the same person.
constexpr double kSamePersonDistance = 0.4;

struct AnchorGrid {
  int cells;     // along a side
  int per_cell;  // all alike
};
constexpr std::array<AnchorGrid, 3> kAnchorGrids = {{{28, 2}, {14, 2}, {7, 6}}};
constexpr int kNumAnchors = 28 * 28 * 2 + 14 * 14 * 2 + 7 * 7 * 6;
// Of an anchor: centre, width and height of the face's box, then four points: the middle of the
// hips, where the stretched body would reach to, and two of the upper body.
constexpr int kNumValues = 12;

using Values = Eigen::Vector<double, kNumValues>;

struct Box {
  Values values;  // shares of the input's side
  double score;
};

double Probability(double logit) { return 1 / (1 + std::exp(-logit)); }

std::vector<Box> Decode(const float* values, const float* logits) {
  std::vector<Box> boxes;
  for (const AnchorGrid& grid : kAnchorGrids) {
    for (int cell = 0; cell < grid.cells * grid.cells; ++cell) {
      const double x = (cell % grid.cells + 0.5) / grid.cells;
      const double y = (cell / grid.cells + 0.5) / grid.cells;
      for (int a = 0; a < grid.per_cell; ++a, values += kNumValues, ++logits) {
        const double score = Probability(*logits);
        if (!(score >= kMinPersonScore)) continue;
        Box& box = boxes.emplace_back();
        box.score = score;
        for (int i = 0; i < kNumValues; ++i) box.values[i] = double{values[i]} / kDetectorInput;
        for (int i = 0; i < kNumValues; i += 2) {
          if (i != 2) box.values.segment<2>(i) += Eigen::Vector2d(x, y);
        }
      }
    }
  }
  return boxes;
}

double Iou(const Values& a, const Values& b) {
  const auto overlap = [&](int axis) {
    const double begin = std::max(a[axis] - a[axis + 2] / 2, b[axis] - b[axis + 2] / 2);
    const double end = std::min(a[axis] + a[axis + 2] / 2, b[axis] + b[axis + 2] / 2);
    return std::max(0.0, end - begin);
  };
  const double both = overlap(0) * overlap(1);
  const double any = a[2] * a[3] + b[2] * b[3] - both;
  return any > 0 ? both / any : 0;
}

// Boxes that overlap the best one become one, their mean weighted by score; and so on.
std::vector<Box> Merge(std::vector<Box> boxes) {
  std::stable_sort(boxes.begin(), boxes.end(),
                   [](const Box& a, const Box& b) { return a.score > b.score; });
  std::vector<Box> merged;
  while (!boxes.empty()) {
    const Box best = boxes.front();
    Values sum = Values::Zero();
    double weight = 0;
    std::vector<Box> others;
    for (const Box& box : boxes) {
      if (&box != &boxes.front() && Iou(best.values, box.values) <= kSamePersonIou) {
        others.push_back(box);
        continue;
      }
      sum += box.score * box.values;
      weight += box.score;
    }
    merged.push_back({sum / weight, best.score});
    boxes = std::move(others);
  }
  return merged;
}

// The area at the middle of the network's square input, as large as fits; black elsewhere.
cv::Mat LetterBox(const cv::Mat& bgr, const cv::Rect& area) {
  const double scale = static_cast<double>(std::max(area.width, area.height)) / kDetectorInput;
  const double shift = scale * (0.5 - kDetectorInput / 2.0) - 0.5;
  const cv::Matx23d picture_from_input(scale, 0, shift + area.x + area.width / 2.0,  //
                                       0, scale, shift + area.y + area.height / 2.0);
  return internal::WarpToSquare(bgr, picture_from_input, kDetectorInput, cv::BORDER_CONSTANT);
}

std::vector<int> TileStarts(int length, int side) {
  const int steps = static_cast<int>(std::ceil(2.0 * (length - side) / side));
  std::vector<int> starts;
  for (int i = 0; i <= steps; ++i) {
    starts.push_back(
        static_cast<int>(std::lround((length - side) * (i / std::max(1.0, 1.0 * steps)))));
  }
  return starts;
}

}  // namespace

PersonDetector::PersonDetector(Network network) : network_(std::move(network)) {
  if (network_.input_width() != 0 &&
      (network_.input_width() != kDetectorInput || network_.input_height() != kDetectorInput)) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{} takes pictures of {}x{}, a person detector {}x{}", network_.name(),
                            network_.input_width(), network_.input_height(), kDetectorInput,
                            kDetectorInput));
  }
}

std::vector<PersonCandidate> PersonDetector::Find(const cv::Mat& bgr, const cv::Rect& area) {
  const cv::Mat blob = cv::dnn::blobFromImage(LetterBox(bgr, area), 2 / 255.0, {},
                                              cv::Scalar::all(127.5), /*swapRB=*/true);
  cv::Mat values, logits;
  for (const cv::Mat& output : network_.Run(blob)) {
    if (output.total() == size_t{kNumAnchors} * kNumValues) values = output;
    if (output.total() == size_t{kNumAnchors}) logits = output;
  }
  if (values.empty() || logits.empty()) {
    throw Error(ErrorCode::kUnsupported, fmt::format("{} is no person detector: it has not {} "
                                                     "anchors",
                                                     network_.name(), kNumAnchors));
  }
  const double scale = std::max(area.width, area.height);
  const Eigen::Vector2d corner(area.x + area.width / 2.0 - scale / 2 - 0.5,
                               area.y + area.height / 2.0 - scale / 2 - 0.5);
  std::vector<PersonCandidate> candidates;
  for (const Box& box : Merge(Decode(values.ptr<float>(), logits.ptr<float>()))) {
    const Eigen::Vector2d hips = corner + scale * box.values.segment<2>(4);
    const Eigen::Vector2d reach = corner + scale * box.values.segment<2>(6);
    if (!hips.allFinite() || !((reach - hips).norm() >= 1)) continue;
    candidates.push_back({PersonRegion::Around(hips, reach), box.score});
  }
  return candidates;
}

std::vector<PersonCandidate> PersonDetector::FindEverywhere(const cv::Mat& bgr) {
  std::vector<PersonCandidate> all = Find(bgr, {0, 0, bgr.cols, bgr.rows});
  const int side = std::max(1, static_cast<int>(kTileShare * std::min(bgr.cols, bgr.rows)));
  for (const int y : TileStarts(bgr.rows, side)) {
    for (const int x : TileStarts(bgr.cols, side)) {
      const std::vector<PersonCandidate> found = Find(bgr, {x, y, side, side});
      all.insert(all.end(), found.begin(), found.end());
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const PersonCandidate& a, const PersonCandidate& b) {
    return a.score > b.score;
  });
  std::vector<PersonCandidate> distinct;
  for (const PersonCandidate& candidate : all) {
    const bool is_known =
        std::any_of(distinct.begin(), distinct.end(), [&](const PersonCandidate& other) {
          return RegionDistance(candidate.region, other.region) < kSamePersonDistance;
        });
    if (!is_known) distinct.push_back(candidate);
  }
  return distinct;
}

}  // namespace mpc
