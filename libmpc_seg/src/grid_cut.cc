#include "mpc/seg/grid_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "mpc/seg/max_flow.h"
#include "mpc/seg/trimap.h"

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

  int32_t operator()(int x, int y, size_t direction) const {
    const Direction& d = kDirections[direction];
    const int diagonal = direction >= 4 ? 1 : 0;
    const cv::Vec3b& a = problem_.bgr.ptr<cv::Vec3b>(y)[x];
    const cv::Vec3b& b = problem_.bgr.ptr<cv::Vec3b>(y + d.dy)[x + d.dx];
    const int db = a[0] - b[0], dg = a[1] - b[1], dr = a[2] - b[2];
    int32_t link = contrast_[diagonal](db * db + dg * dg + dr * dr);
    if (has_motion_) {
      link += motion_[diagonal](problem_.change.ptr<uint16_t>(y)[x] +
                                problem_.change.ptr<uint16_t>(y + d.dy)[x + d.dx]);
    }
    if (!problem_.strength.empty()) {
      const float strength =
          problem_.strength.ptr<float>(y)[x] + problem_.strength.ptr<float>(y + d.dy)[x + d.dx];
      link = cvRound(0.5F * strength * static_cast<float>(link));
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

// The first unknown pixel of a row at or after x, or `width`.
int NextUnknown(const uint8_t* trimap, int x, int width) {
  constexpr uint64_t kUnknownBits = 0x0202020202020202;  // set in the labels of unknown pixels only
  uint64_t eight = 0;
  for (; x + 8 <= width; x += 8) {
    std::memcpy(&eight, trimap + x, sizeof eight);
    if ((eight & kUnknownBits) != 0) break;
  }
  while (x < width && !IsUnknown(trimap[x])) ++x;
  return x;
}

int32_t ScaledLogOdds(const GridCutProblem& problem, int x, int y) {
  const double o = problem.log_odds.at<float>(y, x);
  return cvRound(kScale * std::clamp(o, -kMaxLogOdds, kMaxLogOdds));
}

struct Pixel {
  int16_t x;
  int16_t y;
  int32_t odds;       // log-odds, with the links to decided neighbours
  int32_t links = 0;  // sum over neighbours that are not decided
  bool decided = false;
};

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

template <size_t degree>
GridCutResult Solve(const GridCutProblem& problem) {
  const cv::Size size = problem.trimap.size();
  GridCutResult result;
  result.labels = problem.trimap & 1;  // that of known pixels; all others are set below

  struct Neighbour {
    int32_t pixel = -1;  // -1: known or none
    int32_t link = 0;
  };
  std::vector<Pixel> pixels;
  std::vector<Neighbour> neighbours;  // `degree` per pixel
  const int num_unknown = cv::countNonZero(problem.trimap >= kTrimapUnknownBackground);
  pixels.reserve(static_cast<size_t>(num_unknown));
  neighbours.resize(static_cast<size_t>(num_unknown) * degree);
  // Links of every unknown pixel; those to known pixels are as good as log-odds. A pair of unknown
  // pixels is linked when the later one is reached; `here` and `above` hold the pixels of two rows.
  const Links link_of(problem);
  std::vector<int32_t> here(static_cast<size_t>(size.width)), above(here);
  for (int y = 0; y < size.height; ++y) {
    std::swap(here, above);
    const uint8_t* trimap = problem.trimap.ptr(y);
    for (int x = NextUnknown(trimap, 0, size.width); x < size.width;
         x = NextUnknown(trimap, x + 1, size.width)) {
      const auto p = static_cast<int32_t>(pixels.size());
      here[static_cast<size_t>(x)] = p;
      Pixel& pixel = pixels.emplace_back(
          Pixel{static_cast<int16_t>(x), static_cast<int16_t>(y), ScaledLogOdds(problem, x, y)});
      for (size_t d = 0; d < degree; ++d) {
        const int qx = x + kDirections[d].dx;
        const int qy = y + kDirections[d].dy;
        if (qx < 0 || qy < 0 || qx >= size.width || qy >= size.height) continue;
        const uint8_t other = problem.trimap.ptr(qy)[qx];
        const bool later = d % 2 == 1;
        if (IsUnknown(other) && later) continue;
        const int32_t link = link_of(x, y, d);
        if (!IsUnknown(other)) {
          pixel.odds += other == kTrimapForeground ? link : -link;
          continue;
        }
        const int32_t q = (qy == y ? here : above)[static_cast<size_t>(qx)];
        neighbours[static_cast<size_t>(p) * degree + d] = {q, link};
        neighbours[static_cast<size_t>(q) * degree + (d ^ 1)] = {p, link};
        pixel.links += link;
        pixels[static_cast<size_t>(q)].links += link;
      }
    }
  }
  result.num_unknown = num_unknown;

  // Decide pixels that no labels of their neighbours could turn, which may decide those in turn.
  std::vector<int> pending(pixels.size());
  for (size_t p = 0; p < pixels.size(); ++p) pending[p] = static_cast<int>(pixels.size() - 1 - p);
  while (!pending.empty()) {
    const int p = pending.back();
    pending.pop_back();
    Pixel& pixel = pixels[static_cast<size_t>(p)];
    if (pixel.decided || std::abs(pixel.odds) <= pixel.links) continue;
    pixel.decided = true;
    const bool inside = pixel.odds > 0;
    result.labels.ptr(pixel.y)[pixel.x] = inside;
    for (size_t d = 0; d < degree; ++d) {
      const Neighbour& neighbour = neighbours[static_cast<size_t>(p) * degree + d];
      if (neighbour.pixel < 0 || pixels[static_cast<size_t>(neighbour.pixel)].decided) continue;
      Pixel& other = pixels[static_cast<size_t>(neighbour.pixel)];
      other.odds += inside ? neighbour.link : -neighbour.link;
      other.links -= neighbour.link;
      if (std::abs(other.odds) > other.links) pending.push_back(neighbour.pixel);
    }
  }

  // The others by maximum flow.
  std::vector<int> node(pixels.size(), -1);
  std::vector<int> nodes;
  for (size_t p = 0; p < pixels.size(); ++p) {
    if (pixels[p].decided) continue;
    node[p] = static_cast<int>(nodes.size());
    nodes.push_back(static_cast<int>(p));
  }
  result.num_nodes = static_cast<int>(nodes.size());
  MaxFlow flow(result.num_nodes);
  for (int n = 0; n < result.num_nodes; ++n) {
    const int p = nodes[static_cast<size_t>(n)];
    const int32_t odds = pixels[static_cast<size_t>(p)].odds;
    flow.AddTerminals(n, std::max(odds, 0), std::max(-odds, 0));
    for (size_t d = 1; d < degree; d += 2) {
      const Neighbour& neighbour = neighbours[static_cast<size_t>(p) * degree + d];
      if (neighbour.pixel < 0 || node[static_cast<size_t>(neighbour.pixel)] < 0) continue;
      flow.AddEdge(n, node[static_cast<size_t>(neighbour.pixel)], neighbour.link, neighbour.link);
    }
  }
  flow.Solve();
  for (int n = 0; n < result.num_nodes; ++n) {
    const Pixel& pixel = pixels[static_cast<size_t>(nodes[static_cast<size_t>(n)])];
    result.labels.ptr(pixel.y)[pixel.x] = flow.OnSourceSide(n);
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
      if (unknown && labels.ptr(y)[x]) energy -= ScaledLogOdds(problem, x, y);
      for (size_t d = 1; d < degree; d += 2) {
        const int qx = x + kDirections[d].dx;
        const int qy = y + kDirections[d].dy;
        if (qx < 0 || qy < 0 || qx >= labels.cols || qy >= labels.rows) continue;
        if (!unknown && !IsUnknown(problem.trimap.ptr(qy)[qx])) continue;
        if ((labels.ptr(y)[x] != 0) != (labels.ptr(qy)[qx] != 0)) energy += link_of(x, y, d);
      }
    }
  }
  return energy;
}

}  // namespace mpc
