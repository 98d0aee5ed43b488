#include "mpc/seg/grid_cut.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <random>

#include "mpc/seg/trimap.h"
#include "whole_graph.h"

namespace mpc {
namespace {

cv::Mat RandomPicture(const cv::Size& size, std::mt19937* rng) {
  cv::Mat picture(size, CV_8UC3);
  for (int i = 0; i < picture.rows * picture.cols * 3; ++i) {
    picture.data[i] = static_cast<uint8_t>((*rng)() % 40 + (i / 30 % 2) * 60);
  }
  return picture;
}

GridCutProblem RandomProblem(const cv::Size& size, uint32_t seed, bool eight_connected) {
  std::mt19937 rng(seed);
  GridCutProblem problem;
  problem.bgr = RandomPicture(size, &rng);
  problem.change = SquaredChange(problem.bgr, RandomPicture(size, &rng));
  problem.log_odds.create(size, CV_32F);
  problem.trimap.create(size, CV_8U);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      problem.log_odds.at<float>(y, x) = static_cast<float>(static_cast<int>(rng() % 400) - 200);
      const uint32_t kind = rng() % 8;
      problem.trimap.at<uint8_t>(y, x) = static_cast<uint8_t>(kind < 4 ? kind : 2 + kind % 2);
    }
  }
  problem.gamma = 50;
  problem.beta = ContrastBeta(problem.bgr, eight_connected);
  problem.gamma_motion = 20;
  problem.beta_motion = 0.001;
  problem.eight_connected = eight_connected;
  if (seed % 3 == 1) {
    problem.strength.create(size, CV_32F);
    for (int i = 0; i < size.area(); ++i) {
      problem.strength.ptr<float>()[i] = static_cast<float>(rng() % 101) / 100;
    }
  }
  return problem;
}

// E as the header writes it, in floating point.
double EnergyTwin(const GridCutProblem& problem, const cv::Mat& labels) {
  const auto colour = [&](int x, int y) {
    const cv::Vec3b c = problem.bgr.at<cv::Vec3b>(y, x);
    return cv::Vec3d(c[0], c[1], c[2]);
  };
  const auto unknown = [&](int x, int y) { return problem.trimap.at<uint8_t>(y, x) >= 2; };
  double energy = 0;
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (unknown(x, y) && labels.at<uint8_t>(y, x)) energy -= problem.log_odds.at<float>(y, x);
      for (const cv::Point d :
           {cv::Point(1, 0), cv::Point(0, 1), cv::Point(1, 1), cv::Point(-1, 1)}) {
        if (d.x != 0 && d.y != 0 && !problem.eight_connected) continue;
        const int u = x + d.x, v = y + d.y;
        if (u < 0 || u >= labels.cols || v >= labels.rows) continue;
        if (!unknown(x, y) && !unknown(u, v)) continue;
        if (labels.at<uint8_t>(y, x) == labels.at<uint8_t>(v, u)) continue;
        const cv::Vec3d difference = colour(x, y) - colour(u, v);
        const double change =
            3.0 * problem.change.at<uint16_t>(y, x) + 3.0 * problem.change.at<uint16_t>(v, u);
        const double strength =
            problem.strength.empty()
                ? 1
                : 0.5 * (problem.strength.at<float>(y, x) + problem.strength.at<float>(v, u));
        energy += strength *
                  (problem.gamma * std::exp(-problem.beta * difference.dot(difference)) +
                   problem.gamma_motion * std::exp(-problem.beta_motion * change / 2)) /
                  std::hypot(d.x, d.y);
      }
    }
  }
  return energy;
}

TEST(GridCut, EnergyIsTheOneWritten) {
  for (const bool eight : {false, true}) {
    const GridCutProblem problem = RandomProblem({13, 9}, 1, eight);
    const cv::Mat labels = SolveGridCut(problem).labels;
    EXPECT_NEAR(static_cast<double>(GridCutEnergy(problem, labels)) / 1024,
                EnergyTwin(problem, labels), 0.5);
  }
}

TEST(GridCut, LabelsAreTheBestOfAll) {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    GridCutProblem problem = RandomProblem({3, 3}, seed, seed % 2 == 1);
    const cv::Mat labels = SolveGridCut(problem).labels;
    const int64_t energy = GridCutEnergy(problem, labels);
    for (uint32_t bits = 0; bits < (1U << 9); ++bits) {
      cv::Mat other(3, 3, CV_8U);
      bool agrees = true;
      for (int i = 0; i < 9; ++i) {
        other.data[i] = (bits >> i) & 1;
        const uint8_t t = problem.trimap.data[i];
        agrees = agrees && (t >= 2 || t == other.data[i]);
      }
      if (agrees) {
        ASSERT_LE(energy, GridCutEnergy(problem, other)) << seed;
      }
    }
  }
}

TEST(GridCut, NoChangeOfAnyPixelOrBlockIsBetter) {
  const GridCutProblem problem = RandomProblem({40, 30}, 7, false);
  const GridCutResult result = SolveGridCut(problem);
  const int64_t energy = GridCutEnergy(problem, result.labels);
  std::mt19937 rng(8);
  for (int trial = 0; trial < 300; ++trial) {
    cv::Mat other = result.labels.clone();
    const cv::Rect block =
        cv::Rect(static_cast<int>(rng() % 40), static_cast<int>(rng() % 30),
                 1 + static_cast<int>(rng() % 9), 1 + static_cast<int>(rng() % 9)) &
        cv::Rect(0, 0, 40, 30);
    other(block).setTo(static_cast<double>(rng() % 2),
                       problem.trimap(block) >= kTrimapUnknownBackground);
    EXPECT_GE(GridCutEnergy(problem, other), energy);
  }
}

TEST(GridCut, DecidedPixelsAreThoseOfTheWholeGraph) {
  for (uint32_t seed = 20; seed < 40; ++seed) {
    GridCutProblem problem = RandomProblem({30, 20}, seed, seed % 2 == 1);
    problem.log_odds *= 0.3;  // so that some pixels need the flow
    const GridCutResult result = SolveGridCut(problem);
    EXPECT_GT(result.num_nodes, 0);
    EXPECT_LT(result.num_nodes, result.num_unknown);

    const mpc::testing::WholeGraph graph = mpc::testing::BuildWholeGraph(problem);
    cv::detail::GCGraph<int> flow(static_cast<unsigned>(graph.pixels.size()),
                                  static_cast<unsigned>(2 * graph.edges.size()));
    for (const int odds : graph.log_odds) {
      flow.addTermWeights(flow.addVtx(), std::max(odds, 0), std::max(-odds, 0));
    }
    for (const auto& e : graph.edges) flow.addEdges(e.a, e.b, e.capacity, e.capacity);
    flow.maxFlow();
    cv::Mat whole = result.labels.clone();
    for (size_t n = 0; n < graph.pixels.size(); ++n) {
      whole.at<uint8_t>(graph.pixels[n]) = flow.inSourceSegment(static_cast<int>(n));
    }
    EXPECT_EQ(GridCutEnergy(problem, whole), GridCutEnergy(problem, result.labels)) << seed;
  }
}

TEST(GridCut, SmallChangeBindsNeighbours) {
  // Two halves that differ in nothing but where they changed; the odds at the ends are fixed.
  GridCutProblem problem;
  problem.bgr = cv::Mat(1, 20, CV_8UC3, cv::Scalar(90, 90, 90));
  problem.log_odds = cv::Mat(1, 20, CV_32F, cv::Scalar(0));
  problem.trimap = cv::Mat(1, 20, CV_8U, cv::Scalar(kTrimapUnknownForeground));
  problem.trimap.at<uint8_t>(0, 0) = kTrimapForeground;
  problem.trimap.at<uint8_t>(0, 19) = kTrimapBackground;
  problem.change = cv::Mat(1, 20, CV_16U, cv::Scalar(0));
  problem.change.at<uint16_t>(0, 12) = 5000;
  problem.change.at<uint16_t>(0, 13) = 5000;
  problem.gamma_motion = 20;
  problem.beta_motion = 0.01;
  const cv::Mat labels = SolveGridCut(problem).labels;
  for (int x = 0; x <= 11; ++x) EXPECT_EQ(labels.at<uint8_t>(0, x), 1) << x;
  for (int x = 14; x < 20; ++x) EXPECT_EQ(labels.at<uint8_t>(0, x), 0) << x;
}

TEST(GridCut, BetaIsGrabCutsMean) {
  cv::Mat picture(2, 2, CV_8UC3, cv::Scalar(0, 0, 0));
  picture.at<cv::Vec3b>(0, 0) = {3, 4, 0};  // |difference|^2 = 25 to every neighbour
  EXPECT_DOUBLE_EQ(ContrastBeta(picture, false), 1 / (2 * (25.0 * 2 / 4)));
  EXPECT_DOUBLE_EQ(ContrastBeta(picture, true), 1 / (2 * (25.0 * 3 / 6)));
  EXPECT_EQ(ContrastBeta(cv::Mat(5, 5, CV_8UC3, cv::Scalar(1, 2, 3)), true), 0);
}

TEST(GridCut, ChangeIsExactAtItsEnds) {
  const cv::Mat black(1, 2, CV_8UC3, cv::Scalar::all(0));
  const cv::Mat white(1, 2, CV_8UC3, cv::Scalar::all(255));
  EXPECT_EQ(SquaredChange(black, white).at<uint16_t>(0, 1), 255 * 255);
  EXPECT_EQ(SquaredChange(white, white).at<uint16_t>(0, 1), 0);
}

TEST(GridCut, NothingUnknown) {
  GridCutProblem problem = RandomProblem({8, 8}, 3, false);
  problem.trimap = cv::Mat(8, 8, CV_8U, cv::Scalar(kTrimapForeground));
  const GridCutResult result = SolveGridCut(problem);
  EXPECT_EQ(result.num_unknown, 0);
  EXPECT_EQ(cv::countNonZero(result.labels), 64);
}

}  // namespace
}  // namespace mpc
