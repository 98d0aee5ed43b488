#include "mpc/seg/grid_cut.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mpc/seg/grid_flow.h"
#include "mpc/seg/trimap.h"
#include "unknown_pixels.h"

namespace mpc {
namespace {

constexpr double kScale = 1024;       // integer steps per unit of energy
constexpr double kMaxLogOdds = 1e5;   // keeps sums of a pixel's terms well below 2^30
constexpr double kNoMoreThan = 1e-4;  // links weaker than this part of gamma count as none

// Neighbours in pairs of opposite directions, so that direction d's opposite is d ^ 1. Even ones
// lead to pixels that come earlier, row by row.
struct Direction {
  int dx;
  int dy;
};
constexpr std::array<Direction, 8> kDirections = {
    {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, 1}, {1, -1}, {-1, 1}}};

// gamma exp(-beta x) for integers x >= 0, in steps of the energy.
class ExpTable {
 public:
  ExpTable(double gamma, double beta, int max_x) {
    if (gamma == 0) return;
    const double reach = beta > 0 ? std::min<double>(max_x, -std::log(kNoMoreThan) / beta) : 0;
    values_.resize(static_cast<size_t>(reach) + 1);
    for (size_t x = 0; x < values_.size(); ++x) {
      values_[x] = cvRound(kScale * gamma * std::exp(-beta * static_cast<double>(x)));
    }
    beyond_ = beta > 0 ? 0 : values_[0];
  }
  int32_t operator()(int x) const {
    return static_cast<size_t>(x) < values_.size() ? values_[static_cast<size_t>(x)] : beyond_;
  }

 private:
  std::vector<int32_t> values_;
  int32_t beyond_ = 0;
};

class Links {
 public:
  explicit Links(const GridCutProblem& problem)
      : problem_(problem),
        has_motion_(!problem.change.empty() && problem.gamma_motion > 0),
        contrast_{ExpTable(problem.gamma, problem.beta, kMaxContrast),
                  ExpTable(diagonal() * problem.gamma, problem.beta, kMaxContrast)},
        // change holds |D|^2 / 3, so the sum of two of them times 3/2 is the mean |D|^2.
        motion_{ExpTable(gamma_motion(), 1.5 * problem.beta_motion, kMaxChange),
                ExpTable(diagonal() * gamma_motion(), 1.5 * problem.beta_motion, kMaxChange)} {}

  // What links depend on, of one row.
  struct Row {
    const uint8_t* bgr = nullptr;
    const uint16_t* change = nullptr;
    const float* strength = nullptr;
  };
  Row row(int y) const {
    Row row = {.bgr = problem_.bgr.ptr(y)};
    if (has_motion_) row.change = problem_.change.ptr<uint16_t>(y);
    if (!problem_.strength.empty()) row.strength = problem_.strength.ptr<float>(y);
    return row;
  }

  // Between pixel ax of row a and pixel bx of row b.
  int32_t operator()(const Row& a, int ax, const Row& b, int bx, bool diagonal) const {
    const uint8_t* p = a.bgr + 3 * ax;
    const uint8_t* q = b.bgr + 3 * bx;
    const int db = p[0] - q[0], dg = p[1] - q[1], dr = p[2] - q[2];
    int32_t link = contrast_[diagonal](db * db + dg * dg + dr * dr);
    if (has_motion_) link += motion_[diagonal](a.change[ax] + b.change[bx]);
    if (a.strength != nullptr && b.strength != nullptr) {
      link = cvRound(0.5F * (a.strength[ax] + b.strength[bx]) * static_cast<float>(link));
    }
    return link;
  }

 private:
  static constexpr int kMaxContrast = 3 * 255 * 255;
  static constexpr int kMaxChange = 2 * 255 * 255;

  double gamma_motion() const { return has_motion_ ? problem_.gamma_motion : 0; }
  double diagonal() const { return problem_.eight_connected ? std::sqrt(0.5) : 0; }

  const GridCutProblem& problem_;
  bool has_motion_;
  std::array<ExpTable, 2> contrast_;  // neighbours at distance 1 and sqrt(2)
  std::array<ExpTable, 2> motion_;
};

int32_t ScaledLogOdds(float log_odds) {
  return cvRound(kScale * std::clamp<double>(log_odds, -kMaxLogOdds, kMaxLogOdds));
}

}  // namespace

double ContrastBeta(const cv::Mat& bgr, bool eight_connected) {
  double sum = 0;
  double count = 0;
  const int degree = eight_connected ? 8 : 4;
  for (int direction = 1; direction < degree; direction += 2) {  // each pair once
    const Direction d = kDirections[static_cast<size_t>(direction)];
    const int x_begin = std::max(0, -d.dx), x_end = bgr.cols - std::max(0, d.dx);
    if (x_end <= x_begin) continue;
    const size_t n = 3 * static_cast<size_t>(x_end - x_begin);
    for (int y = 0; y + d.dy < bgr.rows; ++y) {
      const uint8_t* a = bgr.ptr<cv::Vec3b>(y)[x_begin].val;
      const uint8_t* b = bgr.ptr<cv::Vec3b>(y + d.dy)[x_begin + d.dx].val;
      uint32_t row = 0;  // 16384 pixels of 3 * 255^2 fit
      for (size_t i = 0; i < n; ++i) {
        const int difference = a[i] - b[i];
        row += static_cast<uint32_t>(difference * difference);
      }
      sum += row;
      count += x_end - x_begin;
    }
  }
  return sum > 0 ? count / (2 * sum) : 0;
}

cv::Mat SquaredChange(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat change(a.size(), CV_16U);
  for (int y = 0; y < a.rows; ++y) {
    const uint8_t* pa = a.ptr(y);
    const uint8_t* pb = b.ptr(y);
    uint16_t* out = change.ptr<uint16_t>(y);
    for (int x = 0; x < a.cols; ++x, pa += 3, pb += 3) {
      const int db = pa[0] - pb[0], dg = pa[1] - pb[1], dr = pa[2] - pb[2];
      out[x] = static_cast<uint16_t>((db * db + dg * dg + dr * dr + 1) / 3);
    }
  }
  return change;
}

namespace {

template <size_t kDegree>
GridCutResult Solve(const GridCutProblem& problem) {
  const cv::Size size = problem.trimap.size();
  GridCutResult result;
  result.labels = problem.trimap & 1;  // that of known pixels; all others are set below
  result.num_unknown = cv::countNonZero(problem.trimap >= kTrimapUnknownBackground);

  // Links of every unknown pixel; those to known pixels are as good as log-odds. A pair of unknown
  // pixels is linked when the later one is reached; `here` and `above` hold the nodes of two rows.
  GridFlow<kDegree> flow(static_cast<size_t>(result.num_unknown));
  const Links link_of(problem);
  std::vector<int32_t> here(static_cast<size_t>(size.width)), above(here);
  for (int y = 0; y < size.height; ++y) {
    std::swap(here, above);
    const uint8_t* trimap = problem.trimap.ptr(y);
    const float* log_odds = problem.log_odds.ptr<float>(y);
    // The rows before, at and after this one; those outside the picture are not looked at.
    std::array<Links::Row, 3> rows;
    std::array<const uint8_t*, 3> labels{};
    for (size_t i = 0; i < rows.size(); ++i) {
      const int row = y - 1 + static_cast<int>(i);
      if (row < 0 || row >= size.height) continue;
      rows[i] = link_of.row(row);
      labels[i] = problem.trimap.ptr(row);
    }
    ForEachUnknown(trimap, size.width, [&](int x) {
      const int32_t node = here[static_cast<size_t>(x)] = flow.AddNode(ScaledLogOdds(log_odds[x]));
      for (size_t d = 0; d < kDegree; ++d) {
        const int qx = x + kDirections[d].dx;
        const int dy = kDirections[d].dy;
        const size_t row = dy < 0 ? 0 : dy == 0 ? 1 : 2;
        if (qx < 0 || qx >= size.width || labels[row] == nullptr) continue;
        const uint8_t other = labels[row][qx];
        const bool later = d % 2 == 1;
        if (IsUnknown(other) && later) continue;
        const int32_t link = link_of(rows[1], x, rows[row], qx, d >= 4);
        if (IsUnknown(other)) {
          flow.Link(node, d, (row == 1 ? here : above)[static_cast<size_t>(qx)], link);
        } else {
          flow.AddSurplus(node, other == kTrimapForeground ? link : -link);
        }
      }
    });
  }

  result.num_nodes = flow.Solve();
  int32_t node = 0;
  for (int y = 0; y < size.height; ++y) {
    uint8_t* labels = result.labels.ptr(y);
    ForEachUnknown(problem.trimap.ptr(y), size.width,
                   [&](int x) { labels[x] = flow.OnSourceSide(++node); });
  }
  return result;
}

}  // namespace

GridCutResult SolveGridCut(const GridCutProblem& problem) {
  return problem.eight_connected ? Solve<8>(problem) : Solve<4>(problem);
}

int64_t GridCutEnergy(const GridCutProblem& problem, const cv::Mat& labels) {
  const Links link_of(problem);
  const size_t degree = problem.eight_connected ? 8 : 4;
  int64_t energy = 0;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const bool unknown = IsUnknown(problem.trimap.ptr(y)[x]);
      if (unknown && labels.ptr(y)[x]) {
        energy -= ScaledLogOdds(problem.log_odds.ptr<float>(y)[x]);
      }
      for (size_t d = 1; d < degree; d += 2) {
        const int qx = x + kDirections[d].dx;
        const int qy = y + kDirections[d].dy;
        if (qx < 0 || qy < 0 || qx >= labels.cols || qy >= labels.rows) continue;
        if (!unknown && !IsUnknown(problem.trimap.ptr(qy)[qx])) continue;
        if ((labels.ptr(y)[x] != 0) != (labels.ptr(qy)[qx] != 0)) {
          energy += link_of(link_of.row(y), x, link_of.row(qy), qx, d >= 4);
        }
      }
    }
  }
  return energy;
}

}  // namespace mpc
