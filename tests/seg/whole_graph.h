// Purpose: the graph of a whole cut problem, every unknown pixel a node, nothing decided before:
// the twin of SolveGridCut's construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "mpc/seg/grid_cut.h"
#include "mpc/seg/trimap.h"

namespace mpc::testing {

struct WholeGraph {
  struct Edge {
    int a;
    int b;             // the later one
    size_t direction;  // of GridFlow, in which b lies
    int capacity;
  };
  std::vector<cv::Point> pixels;  // of the nodes
  std::vector<int> log_odds;      // terminal: source when positive
  std::vector<Edge> edges;
};

// Of a pixel that comes later, row by row.
inline size_t DirectionOf(const cv::Point& offset) {
  if (offset.y == 0) return 1;
  return offset.x == 0 ? 3 : offset.x > 0 ? 5 : 7;
}

inline WholeGraph BuildWholeGraph(const GridCutProblem& problem) {
  const auto link = [&](const cv::Point& p, const cv::Point& q) {
    const cv::Vec3b a = problem.bgr.at<cv::Vec3b>(p), b = problem.bgr.at<cv::Vec3b>(q);
    double contrast = 0;
    for (int c = 0; c < 3; ++c) contrast += (a[c] - b[c]) * (a[c] - b[c]);
    const double scale = 1024 / std::hypot(p.x - q.x, p.y - q.y);
    int weight = cvRound(scale * problem.gamma * std::exp(-problem.beta * contrast));
    if (!problem.change.empty()) {
      const double change = 1.5 * (problem.change.at<uint16_t>(p) + problem.change.at<uint16_t>(q));
      weight += cvRound(scale * problem.gamma_motion * std::exp(-problem.beta_motion * change));
    }
    if (!problem.strength.empty()) {
      const float strength = problem.strength.at<float>(p) + problem.strength.at<float>(q);
      weight = cvRound(0.5F * strength * static_cast<float>(weight));
    }
    return weight;
  };
  WholeGraph graph;
  const cv::Size size = problem.trimap.size();
  cv::Mat1i index(size, -1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (problem.trimap.at<uint8_t>(y, x) < kTrimapUnknownBackground) continue;
      index(y, x) = static_cast<int>(graph.pixels.size());
      graph.pixels.emplace_back(x, y);
      graph.log_odds.push_back(cvRound(1024.0 * problem.log_odds.at<float>(y, x)));
    }
  }
  for (int n = 0; n < static_cast<int>(graph.pixels.size()); ++n) {
    const cv::Point p = graph.pixels[n];
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const cv::Point q = p + cv::Point(dx, dy);
        if (q == p || !cv::Rect({}, size).contains(q)) continue;
        if (!problem.eight_connected && dx != 0 && dy != 0) continue;
        if (index(q) > n) graph.edges.push_back({n, index(q), DirectionOf({dx, dy}), link(p, q)});
        if (index(q) >= 0) continue;
        const bool inside = problem.trimap.at<uint8_t>(q) == kTrimapForeground;
        graph.log_odds[n] += inside ? link(p, q) : -link(p, q);
      }
    }
  }
  return graph;
}

}  // namespace mpc::testing
