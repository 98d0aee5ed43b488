// Real pictures with hand-made masks (DAVIS "breakdance"). The model's masks are simulated from the
// true ones. Every twelfth frame; MPC_SEG_STRIDE=4 takes every fourth, as docs/segmentation.md does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <string>
#include <vector>

#include "mpc/seg/colour_model.h"
#include "mpc/seg/grid_cut.h"
#include "mpc/seg/grid_flow.h"
#include "mpc/seg/silhouette.h"
#include "mpc/seg/trimap.h"
#include "simulated_masks.h"
#include "support/data_dir.h"
#include "whole_graph.h"

namespace mpc {
namespace {

using mpc::testing::MaskErrors;
using mpc::testing::MaskIou;
using mpc::testing::SimulatedMasks;
using mpc::testing::SimulateMasks;

struct ClipFrame {
  int index = 0;
  cv::Mat picture;
  cv::Mat previous;
  cv::Mat next;
  cv::Mat truth;
};

int Stride() {
  const char* stride = std::getenv("MPC_SEG_STRIDE");
  return stride != nullptr ? std::max(1, std::atoi(stride)) : 12;
}

// The clip as it is, or as a camera sees it that pans over it. `similar`: colours drawn together,
// towards their mean, so that actor and background are hard to tell apart.
std::vector<ClipFrame> LoadClip(bool pan, bool similar = false) {
  const std::filesystem::path dir = *mpc::testing::DataDir() / "video" / "breakdance";
  const auto picture = [&](int i) {
    cv::Mat image = cv::imread((dir / "rgb" / cv::format("%05d.jpg", i)).string());
    if (similar) {
      const cv::Scalar mean = cv::mean(image);
      cv::Mat grey;
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      cv::cvtColor(grey, grey, cv::COLOR_GRAY2BGR);
      cv::addWeighted(image, 0.25, grey, 0.35, 0.4 * (mean[0] + mean[1] + mean[2]) / 3, image);
    }
    return image;
  };
  const auto window = [&](int i) {
    if (!pan) return cv::Rect(0, 0, 854, 480);
    const double x = (854 - 620) * (0.5 + 0.5 * std::sin(0.13 * i));
    const double y = (480 - 440) * (0.5 + 0.5 * std::cos(0.21 * i));
    return cv::Rect(cvRound(x), cvRound(y), 620, 440);
  };
  std::vector<ClipFrame> frames;
  constexpr int kNumFrames = 84;
  for (int i = 0; i < kNumFrames; i += Stride()) {
    ClipFrame frame;
    frame.index = i;
    frame.picture = picture(i)(window(i)).clone();
    if (i > 0) frame.previous = picture(i - 1)(window(i - 1)).clone();
    if (i + 1 < kNumFrames) frame.next = picture(i + 1)(window(i + 1)).clone();
    const cv::Mat mask =
        cv::imread((dir / "mask" / cv::format("%05d.png", i)).string(), cv::IMREAD_GRAYSCALE);
    frame.truth = mask(window(i)) > 0;
    if (cv::countNonZero(frame.truth) > 1000) frames.push_back(frame);
  }
  return frames;
}

struct Score {
  double mean = 0;
  double worst = 0;  // mean of the lowest tenth
};

Score ScoreOf(std::vector<double> ious) {
  std::sort(ious.begin(), ious.end());
  const size_t tenth = std::max<size_t>(1, ious.size() / 10);
  Score score;
  for (size_t i = 0; i < ious.size(); ++i) {
    score.mean += ious[i] / static_cast<double>(ious.size());
    if (i < tenth) score.worst += ious[i] / static_cast<double>(tenth);
  }
  return score;
}

struct Scores {
  Score model, grabcut1, grabcut5, paper, without_motion, ours;
};

double GrabCutIou(const ClipFrame& frame, const cv::Mat& trimap, int rounds) {
  cv::Mat labels = trimap.clone();
  cv::Mat background, actor;
  cv::theRNG() = cv::RNG(1);
  cv::grabCut(frame.picture, labels, {}, background, actor, rounds, cv::GC_INIT_WITH_MASK);
  return MaskIou(labels & 1, frame.truth);
}

Scores Evaluate(const char* name, const std::vector<ClipFrame>& frames, const MaskErrors& errors,
                const SegmentationOptions& options = {}) {
  std::vector<double> model, one, five, paper, still, ours;
  SegmentationOptions without_motion = options;
  without_motion.gamma_motion = 0;
  without_motion.weight_still = 0;
  for (const ClipFrame& frame : frames) {
    const SimulatedMasks masks = SimulateMasks(frame.truth, errors, 1000 + frame.index);
    FrameInput input;
    input.picture = frame.picture;
    input.previous = frame.previous;
    input.next = frame.next;
    input.model_mask = masks.model;
    input.skeleton_mask = masks.skeleton;
    const double size = ActorSizePx(masks.model);
    const cv::Mat trimap =
        MakeTrimap(masks.skeleton, masks.model, {options.erode * size, options.dilate * size});
    model.push_back(MaskIou(masks.model, frame.truth));
    one.push_back(GrabCutIou(frame, trimap, 1));
    five.push_back(GrabCutIou(frame, trimap, 5));
    paper.push_back(
        MaskIou(ExtractSilhouette(input, SegmentationOptions::Paper()).mask, frame.truth));
    still.push_back(MaskIou(ExtractSilhouette(input, without_motion).mask, frame.truth));
    ours.push_back(MaskIou(ExtractSilhouette(input, options).mask, frame.truth));
  }
  const Scores s = {ScoreOf(model), ScoreOf(one),   ScoreOf(five),
                    ScoreOf(paper), ScoreOf(still), ScoreOf(ours)};
  std::printf("| %s (%zu) |", name, frames.size());
  for (const Score& c : {s.model, s.grabcut1, s.grabcut5, s.paper, s.without_motion, s.ours}) {
    std::printf(" %.4f / %.4f |", c.mean, c.worst);
  }
  std::printf("\n");
  return s;
}

void ExpectNotBelowGrabCut(const Scores& s, double margin) {
  EXPECT_GE(s.ours.mean, std::max(s.grabcut1.mean, s.grabcut5.mean) + margin);
  EXPECT_GE(s.ours.worst, std::max(s.grabcut1.worst, s.grabcut5.worst) + margin);
  EXPECT_GE(s.without_motion.mean, std::max(s.grabcut1.mean, s.grabcut5.mean));
  EXPECT_GT(s.ours.mean, s.without_motion.mean - 0.002);
}

TEST(Davis, StaticCamera) {
  MPC_REQUIRE_DATA();
  const Scores s = Evaluate("static", LoadClip(false), {});
  ExpectNotBelowGrabCut(s, 0.01);
  EXPECT_GT(s.ours.mean, s.model.mean + 0.02);
}

TEST(Davis, PanningCamera) {
  MPC_REQUIRE_DATA();
  const Scores s = Evaluate("panning", LoadClip(true), {});
  ExpectNotBelowGrabCut(s, 0.01);
  EXPECT_GT(s.ours.mean, s.model.mean + 0.02);
}

TEST(Davis, SmallErrors) {
  MPC_REQUIRE_DATA();
  const MaskErrors small = {.warp_px = 5, .shift_px = 2, .grow_px = 2};
  ExpectNotBelowGrabCut(Evaluate("small errors", LoadClip(false), small), 0.01);
}

TEST(Davis, AfterRefinement) {
  MPC_REQUIRE_DATA();
  const MaskErrors small = {.warp_px = 5, .shift_px = 2, .grow_px = 2};
  const Scores s = Evaluate("small errors, half the band", LoadClip(false), small,
                            SegmentationOptions::AfterRefinement());
  ExpectNotBelowGrabCut(s, 0.01);
  EXPECT_GT(s.ours.mean, s.model.mean - 0.01);
}

TEST(Davis, GrossErrorsAndSimilarColours) {
  MPC_REQUIRE_DATA();
  const MaskErrors gross = {.warp_px = 20, .shift_px = 10, .grow_px = 6};
  ExpectNotBelowGrabCut(Evaluate("gross, similar", LoadClip(false, true), gross), 0.01);
}

// With terminals exchanged for a sign of -1.
template <size_t kDegree>
std::vector<bool> SourceSide(const mpc::testing::WholeGraph& graph, int sign) {
  GridFlow<kDegree> flow(graph.pixels.size());
  for (const int odds : graph.log_odds) flow.AddNode(sign * odds);
  for (const auto& e : graph.edges) flow.Link(e.a + 1, e.direction, e.b + 1, e.capacity);
  flow.Solve();
  std::vector<bool> side;
  for (size_t n = 1; n <= graph.pixels.size(); ++n) {
    side.push_back(flow.OnSourceSide(static_cast<int32_t>(n)));
  }
  return side;
}

int64_t CutValue(const mpc::testing::WholeGraph& graph, const std::vector<bool>& source_side) {
  int64_t value = 0;
  for (size_t n = 0; n < graph.pixels.size(); ++n) {
    value += std::max(0, source_side[n] ? -graph.log_odds[n] : graph.log_odds[n]);
  }
  for (const auto& e : graph.edges) {
    if (source_side[e.a] != source_side[e.b]) value += e.capacity;
  }
  return value;
}

// The graphs of 25 frames, with 4 and 8 neighbours, no pixel decided before.
TEST(Davis, GridFlowEqualsOpenCvOnRealGraphs) {
  MPC_REQUIRE_DATA();
  const std::filesystem::path dir = *mpc::testing::DataDir() / "video" / "breakdance";
  const auto colours_where = [](const cv::Mat& picture, const cv::Mat& mask) {
    std::vector<WeightedColour> colours;
    for (int y = 0; y < mask.rows; y += 2) {
      for (int x = 0; x < mask.cols; x += 2) {
        if (mask.at<uint8_t>(y, x) == 0) continue;
        const cv::Vec3b c = picture.at<cv::Vec3b>(y, x);
        colours.push_back({Eigen::Vector3f(c[0], c[1], c[2])});
      }
    }
    return colours;
  };
  int num_unique = 0;
  for (int i = 0; i < 75; i += 3) {
    const cv::Mat picture = cv::imread((dir / "rgb" / cv::format("%05d.jpg", i)).string());
    const cv::Mat previous =
        cv::imread((dir / "rgb" / cv::format("%05d.jpg", std::max(0, i - 1))).string());
    const cv::Mat mask =
        cv::imread((dir / "mask" / cv::format("%05d.png", i)).string(), cv::IMREAD_GRAYSCALE);
    const SimulatedMasks masks = SimulateMasks(mask > 0, {}, 1000 + i);
    const double size = ActorSizePx(masks.model);
    GridCutProblem problem;
    problem.bgr = picture;
    problem.trimap = MakeTrimap(masks.skeleton, masks.model, {0.1 * size, 0.1 * size});
    problem.change = SquaredChange(picture, previous);
    problem.gamma_motion = 20;
    problem.beta_motion = 0.005;
    const ColourModel actor(colours_where(picture, problem.trimap == kTrimapForeground), 5);
    const ColourModel rest(colours_where(picture, problem.trimap == kTrimapBackground), 5);
    problem.log_odds.create(picture.size(), CV_32F);
    for (int y = 0; y < picture.rows; ++y) {
      for (int x = 0; x < picture.cols; ++x) {
        if (problem.trimap.at<uint8_t>(y, x) < kTrimapUnknownBackground) continue;
        const cv::Vec3b c = picture.at<cv::Vec3b>(y, x);
        const Eigen::Vector3f bgr(c[0], c[1], c[2]);
        problem.log_odds.at<float>(y, x) = rest.NegLogLikelihood(bgr) - actor.NegLogLikelihood(bgr);
      }
    }
    for (const bool eight : {false, true}) {
      problem.eight_connected = eight;
      problem.beta = ContrastBeta(picture, eight);
      const mpc::testing::WholeGraph graph = mpc::testing::BuildWholeGraph(problem);
      const int n = static_cast<int>(graph.pixels.size());
      cv::detail::GCGraph<int> theirs(static_cast<unsigned>(n),
                                      static_cast<unsigned>(2 * graph.edges.size()));
      for (int p = 0; p < n; ++p) {
        const int source = std::max(graph.log_odds[p], 0), sink = std::max(-graph.log_odds[p], 0);
        theirs.addTermWeights(theirs.addVtx(), source, sink);
      }
      for (const auto& e : graph.edges) {
        theirs.addEdges(e.a, e.b, e.capacity, e.capacity);
      }
      const int64_t value = theirs.maxFlow();
      const std::vector<bool> ours = eight ? SourceSide<8>(graph, 1) : SourceSide<4>(graph, 1);
      const std::vector<bool> reverse = eight ? SourceSide<8>(graph, -1) : SourceSide<4>(graph, -1);
      int num_different = 0, num_ambiguous = 0;
      cv::Mat whole = (problem.trimap == kTrimapForeground) / 255;
      for (int p = 0; p < n; ++p) {
        const bool side = ours[p];
        whole.at<uint8_t>(graph.pixels[p]) = side;
        const bool ambiguous = side == reverse[p];
        num_ambiguous += ambiguous;
        num_different += !ambiguous && side != theirs.inSourceSegment(p);
      }
      EXPECT_EQ(CutValue(graph, ours), value) << i;
      EXPECT_EQ(num_different, 0) << i;
      num_unique += num_ambiguous == 0;
      // The twin may round a link the other way.
      const int64_t energy = GridCutEnergy(problem, SolveGridCut(problem).labels);
      EXPECT_LE(std::abs(GridCutEnergy(problem, whole) - energy), 16);
    }
  }
  EXPECT_GT(num_unique, 25);
}

}  // namespace
}  // namespace mpc
