// Silhouette extraction at 1080p beside cv::grabCut on the same frame, the same trimap and in the
// same run; the maximum flow beside OpenCV's graph cut.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <random>
#include <vector>

#include "mpc/seg/background_motion.h"
#include "mpc/seg/background_plate.h"
#include "mpc/seg/contour.h"
#include "mpc/seg/grid_flow.h"
#include "mpc/seg/silhouette.h"
#include "mpc/seg/trimap.h"
#include "seg/simulated_masks.h"
#include "seg/test_scene.h"

namespace mpc {
namespace {

// A standing figure 900 px tall before a textured background, its model warped as in docs.
struct Frame {
  FrameInput input;
  cv::Mat trimap;
  cv::Rect crop;
};

const Frame& TestFrame() {
  static const Frame frame = [] {
    cv::setNumThreads(1);
    testing::TestSceneOptions options;
    options.size = {1920, 1080};
    options.centre = {960, 540};
    options.height = 900;
    const testing::TestScene now = testing::MakeScene(options);
    options.centre += cv::Point2d(25, 10);
    options.seed = 2;
    Frame f;
    f.input.picture = now.picture;
    f.input.previous = testing::MakeScene(options).picture;
    options.centre -= cv::Point2d(50, 20);
    options.seed = 3;
    f.input.next = testing::MakeScene(options).picture;
    const testing::MaskErrors errors = {24, 12, 8, 6};
    const testing::SimulatedMasks masks = testing::SimulateMasks(now.truth, errors, 1);
    f.input.model_mask = masks.model;
    f.input.skeleton_mask = masks.skeleton;
    const SegmentationOptions defaults;
    const double size = ActorSizePx(masks.model);
    f.trimap =
        MakeTrimap(masks.skeleton, masks.model, {defaults.erode * size, defaults.dilate * size});
    f.crop = mpc::ExtractSilhouette(f.input).roi;
    return f;
  }();
  return frame;
}

void ExtractSilhouette(benchmark::State& state) {
  const Frame& frame = TestFrame();
  for (auto _ : state) benchmark::DoNotOptimize(mpc::ExtractSilhouette(frame.input));
}
BENCHMARK(ExtractSilhouette)->Unit(benchmark::kMillisecond);

void ExtractSilhouetteStaticCamera(benchmark::State& state) {
  SegmentationOptions options;
  options.estimate_background_motion = false;
  const Frame& frame = TestFrame();
  for (auto _ : state) benchmark::DoNotOptimize(mpc::ExtractSilhouette(frame.input, options));
}
BENCHMARK(ExtractSilhouetteStaticCamera)->Unit(benchmark::kMillisecond);

void GrabCut(benchmark::State& state, bool crop, int num_rounds) {
  const Frame& frame = TestFrame();
  const cv::Rect area = crop ? frame.crop : cv::Rect({}, frame.input.picture.size());
  const cv::Mat picture = frame.input.picture(area).clone();
  for (auto _ : state) {
    cv::Mat labels = frame.trimap(area).clone();
    cv::Mat background, actor;
    cv::theRNG() = cv::RNG(1);
    cv::grabCut(picture, labels, {}, background, actor, num_rounds, cv::GC_INIT_WITH_MASK);
    benchmark::DoNotOptimize(labels.data);
  }
}

void ExtractSilhouette_BaselineFrame1Round(benchmark::State& state) { GrabCut(state, false, 1); }
BENCHMARK(ExtractSilhouette_BaselineFrame1Round)->Unit(benchmark::kMillisecond);

void ExtractSilhouette_BaselineFrame5Rounds(benchmark::State& state) { GrabCut(state, false, 5); }
BENCHMARK(ExtractSilhouette_BaselineFrame5Rounds)->Unit(benchmark::kMillisecond);

void ExtractSilhouette_BaselineCrop1Round(benchmark::State& state) { GrabCut(state, true, 1); }
BENCHMARK(ExtractSilhouette_BaselineCrop1Round)->Unit(benchmark::kMillisecond);

// The paper's preset: the whole crop at full size, 5 rounds.
void ExtractSilhouette_BaselinePaperPreset(benchmark::State& state) {
  const SegmentationOptions options = SegmentationOptions::Paper();
  const Frame& frame = TestFrame();
  for (auto _ : state) benchmark::DoNotOptimize(mpc::ExtractSilhouette(frame.input, options));
}
BENCHMARK(ExtractSilhouette_BaselinePaperPreset)->Unit(benchmark::kMillisecond);

void BackgroundMotion(benchmark::State& state) {
  const Frame& frame = TestFrame();
  for (auto _ : state) {
    benchmark::DoNotOptimize(EstimateBackgroundMotion(frame.input.previous, frame.input.picture,
                                                      frame.input.model_mask));
  }
}
BENCHMARK(BackgroundMotion)->Unit(benchmark::kMillisecond);

// 24 pictures of 1080p in which the figure is nowhere twice.
const std::vector<PlateSample>& PlateSamples() {
  static const std::vector<PlateSample> samples = [] {
    std::vector<PlateSample> all;
    testing::TestSceneOptions options;
    options.size = {1920, 1080};
    options.height = 900;
    for (int i = 0; i < 24; ++i) {
      options.centre = {40.0 + 80 * i, 540};
      options.seed = static_cast<uint32_t>(i + 1);
      const testing::TestScene scene = testing::MakeScene(options);
      all.push_back({scene.picture, scene.truth});
    }
    return all;
  }();
  return samples;
}

void BackgroundPlateOf24(benchmark::State& state) {
  const std::vector<PlateSample>& samples = PlateSamples();
  for (auto _ : state) benchmark::DoNotOptimize(MakeBackgroundPlate(samples));
}
BENCHMARK(BackgroundPlateOf24)->Unit(benchmark::kMillisecond);

// Median and spread by std::nth_element, pixel by pixel and without asking where the actor is.
void BackgroundPlateOf24_BaselineNthElement(benchmark::State& state) {
  const std::vector<PlateSample>& samples = PlateSamples();
  const cv::Size size = samples.front().picture.size();
  const auto median = [](std::vector<uint8_t>* values) {
    const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
    std::nth_element(values->begin(), middle, values->end());
    return *middle;
  };
  std::vector<uint8_t> values(samples.size());
  for (auto _ : state) {
    cv::Mat plate(size, CV_8UC3), spread(size, CV_8UC3);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < 3 * size.width; ++x) {
        for (size_t s = 0; s < samples.size(); ++s) values[s] = samples[s].picture.ptr(y)[x];
        const uint8_t middle = plate.ptr(y)[x] = median(&values);
        for (uint8_t& value : values) {
          value = static_cast<uint8_t>(value > middle ? value - middle : middle - value);
        }
        spread.ptr(y)[x] = median(&values);
      }
    }
    benchmark::DoNotOptimize(spread.data);
  }
}
BENCHMARK(BackgroundPlateOf24_BaselineNthElement)->Unit(benchmark::kMillisecond);

void ExtractSilhouetteWithPlate(benchmark::State& state) {
  FrameInput input = TestFrame().input;
  input.background = MakeBackgroundPlate(PlateSamples());
  for (auto _ : state) benchmark::DoNotOptimize(mpc::ExtractSilhouette(input));
}
BENCHMARK(ExtractSilhouetteWithPlate)->Unit(benchmark::kMillisecond);

void Contour(benchmark::State& state) {
  const cv::Mat mask = mpc::ExtractSilhouette(TestFrame().input).mask;
  for (auto _ : state) benchmark::DoNotOptimize(ExtractContour(mask));
}
BENCHMARK(Contour)->Unit(benchmark::kMillisecond);

// A grid of side x side nodes with smooth terminals and random links, as segmentation makes them.
template <typename AddTerminals, typename AddEdge>
void BuildGrid(int side, const AddTerminals& add_terminals, const AddEdge& add_edge) {
  std::mt19937 rng(1);
  cv::Mat1f odds(side, side);
  cv::RNG(1).fill(odds, cv::RNG::NORMAL, 0, 1);
  cv::GaussianBlur(odds, odds, {}, 5);
  odds *= 20000;
  for (int n = 0; n < side * side; ++n) {
    const int o = static_cast<int>(odds(n / side, n % side));
    add_terminals(n, std::max(o, 0), std::max(-o, 0));
  }
  for (int n = 0; n < side * side; ++n) {
    if (n % side + 1 < side) add_edge(n, n + 1, static_cast<int>(rng() % 8000));
    if (n + side < side * side) add_edge(n, n + side, static_cast<int>(rng() % 8000));
  }
}

void MaximumFlow(benchmark::State& state) {
  const int side = static_cast<int>(state.range(0));
  for (auto _ : state) {
    GridFlow<4> flow(static_cast<size_t>(side) * static_cast<size_t>(side));
    BuildGrid(
        side, [&](int, int s, int t) { flow.AddNode(s - t); },
        [&](int a, int b, int c) { flow.Link(a + 1, b == a + 1 ? 1 : 3, b + 1, c); });
    benchmark::DoNotOptimize(flow.Solve());
  }
}
BENCHMARK(MaximumFlow)->Arg(200)->Unit(benchmark::kMillisecond);

void MaximumFlow_BaselineOpenCv(benchmark::State& state) {
  const int side = static_cast<int>(state.range(0));
  for (auto _ : state) {
    cv::detail::GCGraph<double> flow(static_cast<unsigned>(side * side),
                                     static_cast<unsigned>(4 * side * side));
    for (int n = 0; n < side * side; ++n) flow.addVtx();
    BuildGrid(
        side, [&](int n, int s, int t) { flow.addTermWeights(n, s, t); },
        [&](int a, int b, int c) { flow.addEdges(a, b, c, c); });
    benchmark::DoNotOptimize(flow.maxFlow());
  }
}
BENCHMARK(MaximumFlow_BaselineOpenCv)->Arg(200)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
