// Speed of mpc::detect on 720p pictures of the synthetic actor, beside plainer ways. Needs the networks
// (scripts/get_models.sh); what needs them reports an error without. Names as in README.md.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/dnn.hpp>
#include <optional>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/detect/models.h"
#include "mpc/detect/person_mask.h"
#include "mpc/detect/pose_tracker.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/eval/motions.h"
#include "mpc/eval/synthetic_performance.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {
namespace {

constexpr double kFps = 30;

// A quarter of a second of walking.
const std::vector<cv::Mat>& Pictures() {
  static const std::vector<cv::Mat> pictures = [] {
    const RigAsset rig = MakeDressedActor().rig;
    const Character character = BuildCharacter(rig, MapRigByNames(rig));
    PerformanceOptions options;
    options.camera.width = 1280;
    options.camera.height = 720;
    options.scene.samples = 1;
    const Eigen::MatrixXd poses = MakeMotion(character.skeleton, MotionKind::kWalk, 0.25, kFps);
    const SyntheticPerformance performance =
        MakePerformance(character, ActWithSkinning(character, poses, kFps), options);
    std::vector<cv::Mat> frames;
    RenderPerformance(performance, *MakeScene(performance, rig, character), 1,
                      [&](const RenderedFrame& frame) { frames.push_back(frame.bgr); });
    return frames;
  }();
  return pictures;
}

// The networks' files, on one thread; nothing, and an error in the table, when they are not there.
std::optional<PoseModels> Models(benchmark::State& state) {
  cv::setNumThreads(1);
  try {
    return FindPoseModels();
  } catch (const Error& error) {
    state.SkipWithError(error.what());
    return std::nullopt;
  }
}

PersonRegion WholePerson(const cv::Mat& picture) {
  return {.center = {picture.cols / 2.0, picture.rows / 2.0}, .size_px = 700, .rotation_rad = 0.2};
}

void ReadNetwork(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  for (auto _ : state) benchmark::DoNotOptimize(Network::Read(models->landmarker));
}
BENCHMARK(ReadNetwork)->Unit(benchmark::kMillisecond);

// The least that any reader does: the file's bytes, and half floats made floats.
void ReadNetwork_BaselineBytesToFloats(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  for (auto _ : state) {
    std::ifstream file(models->landmarker, std::ios::binary);
    std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
    cv::Mat floats;
    cv::convertFp16(cv::Mat(1, static_cast<int>(bytes.size() / 2), CV_16S, bytes.data()), floats);
    benchmark::DoNotOptimize(floats.data);
  }
}
BENCHMARK(ReadNetwork_BaselineBytesToFloats)->Unit(benchmark::kMillisecond);

void Crop(benchmark::State& state) {
  const cv::Mat& picture = Pictures().front();
  cv::setNumThreads(1);
  for (auto _ : state) benchmark::DoNotOptimize(CropRegion(picture, WholePerson(picture), 256));
}
BENCHMARK(Crop)->Unit(benchmark::kMicrosecond);

// The same samples per pixel, in plain loops.
void Crop_BaselinePlainLoops(benchmark::State& state) {
  const cv::Mat& picture = Pictures().front();
  const PersonRegion region = WholePerson(picture);
  const int samples = static_cast<int>(std::ceil(region.size_px / 256));
  cv::Mat square(256, 256, CV_8UC3);
  for (auto _ : state) {
    for (int y = 0; y < 256; ++y) {
      for (int x = 0; x < 256; ++x) {
        cv::Vec3f sum = {0, 0, 0};
        for (int s = 0; s < samples * samples; ++s) {
          const Eigen::Vector2d at = region.PixelAt({(x + (s % samples + 0.5) / samples) / 256,
                                                     (y + (s / samples + 0.5) / samples) / 256});
          const int column = static_cast<int>(std::floor(at.x()));
          const int row = static_cast<int>(std::floor(at.y()));
          const auto pixel = [&](int r, int c) {
            return cv::Vec3f(picture.at<cv::Vec3b>(std::clamp(r, 0, picture.rows - 1),
                                                   std::clamp(c, 0, picture.cols - 1)));
          };
          const auto u = static_cast<float>(at.x() - column);
          const auto v = static_cast<float>(at.y() - row);
          sum += (1 - v) * ((1 - u) * pixel(row, column) + u * pixel(row, column + 1)) +
                 v * ((1 - u) * pixel(row + 1, column) + u * pixel(row + 1, column + 1));
        }
        square.at<cv::Vec3b>(y, x) = sum / static_cast<float>(samples * samples);
      }
    }
    benchmark::DoNotOptimize(square.data);
  }
}
BENCHMARK(Crop_BaselinePlainLoops)->Unit(benchmark::kMicrosecond);

void PasteMask(benchmark::State& state) {
  const cv::Mat& picture = Pictures().front();
  cv::setNumThreads(1);
  const PersonMask mask = {.region = WholePerson(picture),
                           .probability = cv::Mat(128, 128, CV_8U, cv::Scalar(200))};
  for (auto _ : state) benchmark::DoNotOptimize(PictureMask(mask, picture.size()));
}
BENCHMARK(PasteMask)->Unit(benchmark::kMicrosecond);

// Finding people in the whole picture. The baseline is the network alone: what is left is the letter
// box, anchors, scores and merging.
void FindPersons(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  PersonDetector detector(Network::Read(models->detector));
  const cv::Mat& picture = Pictures().front();
  for (auto _ : state) {
    benchmark::DoNotOptimize(detector.Find(picture, {0, 0, picture.cols, picture.rows}));
  }
}
BENCHMARK(FindPersons)->Unit(benchmark::kMillisecond);

void RunNetwork(benchmark::State& state, const std::filesystem::path& path) {
  Network network = Network::Read(path);
  const int sizes[] = {1, 3, network.input_height(), network.input_width()};
  const cv::Mat blob(4, sizes, CV_32F, cv::Scalar(0.5));
  for (auto _ : state) benchmark::DoNotOptimize(network.Run(blob));
}

void FindPersons_BaselineNetworkAlone(benchmark::State& state) {
  if (const auto models = Models(state)) RunNetwork(state, models->detector);
}
BENCHMARK(FindPersons_BaselineNetworkAlone)->Unit(benchmark::kMillisecond);

void FindLandmarks(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  PoseLandmarker landmarker(Network::Read(models->landmarker));
  const cv::Mat& picture = Pictures().front();
  for (auto _ : state) {
    benchmark::DoNotOptimize(landmarker.Find(picture, WholePerson(picture)));
  }
}
BENCHMARK(FindLandmarks)->Unit(benchmark::kMillisecond);

void FindLandmarks_BaselineNetworkAlone(benchmark::State& state) {
  if (const auto models = Models(state)) RunNetwork(state, models->landmarker);
}
BENCHMARK(FindLandmarks_BaselineNetworkAlone)->Unit(benchmark::kMillisecond);

// A quarter of a second of the clip, from the first look at it.
void TrackQuarterSecond(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  for (auto _ : state) {
    state.PauseTiming();
    PoseTracker tracker(PersonDetector(Network::Read(models->detector)),
                        PoseLandmarker(Network::Read(models->landmarker)), kFps);
    state.ResumeTiming();
    int frame = 0;
    for (const cv::Mat& picture : Pictures()) {
      benchmark::DoNotOptimize(tracker.Next(picture, frame++));
    }
  }
}
BENCHMARK(TrackQuarterSecond)->Unit(benchmark::kMillisecond)->Iterations(1);

// No tracking: people are searched in every frame, in the whole picture and its parts.
void TrackQuarterSecond_BaselineSearchEveryFrame(benchmark::State& state) {
  const auto models = Models(state);
  if (!models) return;
  PersonDetector detector(Network::Read(models->detector));
  PoseLandmarker landmarker(Network::Read(models->landmarker));
  for (auto _ : state) {
    for (const cv::Mat& picture : Pictures()) {
      const std::vector<PersonCandidate> found = detector.FindEverywhere(picture);
      if (!found.empty()) {
        benchmark::DoNotOptimize(landmarker.Find(picture, found.front().region));
      }
    }
  }
}
BENCHMARK(TrackQuarterSecond_BaselineSearchEveryFrame)
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);

}  // namespace
}  // namespace mpc
