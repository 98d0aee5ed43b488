// Speed of mpc::io on the actor's own mesh (about 13,000 vertices) and 720p pictures, beside what one
// would write with the libraries alone. Files go to a temporary folder; names as in README.md.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>
#include <string>
#include <vector>
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#include <tiny_gltf.h>

#include "io/random_performance.h"
#include "io/temp_dir.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/io/bvh.h"
#include "mpc/io/detections_file.h"
#include "mpc/io/gltf.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/io/video.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {
namespace {

constexpr int kFrames = 30;

// The actor in random poses; the surface waves away from its skin below the waist, as cloth would.
struct Take {
  Take() {
    WriteRigGltf(source, MakeDressedActor().rig);
    rig = ReadRigGltf(source);
    performance =
        testing::RandomPerformance(rig, BuildCharacter(rig, MapRigByNames(rig)), kFrames, 30);
    surface = testing::WavingSurface(rig, performance, 0);
    const Eigen::Matrix3Xf& at_rest = rig.meshes[0].mesh.positions;
    for (Eigen::Matrix3Xf& positions : surface) {
      for (Eigen::Index v = 0; v < positions.cols(); ++v) {
        if (at_rest(1, v) < 1) positions(0, v) += 0.01F * std::sin(9 * positions(1, v));
      }
    }
  }
  testing::TempDir dir;
  std::filesystem::path source = dir / "actor.glb";
  RigAsset rig;
  GltfPerformance performance;
  std::vector<Eigen::Matrix3Xf> surface;
};

void ReadRig(benchmark::State& state) {
  const Take take;
  for (auto _ : state) benchmark::DoNotOptimize(ReadRigGltf(take.source));
}
BENCHMARK(ReadRig)->Unit(benchmark::kMillisecond);

tinygltf::Model Load(const std::filesystem::path& path) {
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader([](tinygltf::Image*, int, std::string*, std::string*, int, int,
                           const unsigned char*, int, void*) { return true; },
                        nullptr);
  tinygltf::Model model;
  std::string error, warning;
  loader.LoadBinaryFromFile(&model, &error, &warning, path.string());
  return model;
}

// Parsing alone: nothing checked, no mesh made.
void ReadRig_BaselineTinygltf(benchmark::State& state) {
  const Take take;
  for (auto _ : state) benchmark::DoNotOptimize(Load(take.source));
}
BENCHMARK(ReadRig_BaselineTinygltf)->Unit(benchmark::kMillisecond);

// Bones, camera-less; a morph target per frame, solved back through the skinning.
void WriteGltfSurface(benchmark::State& state) {
  Take take;
  Pc2Reader reader = testing::WriteSurface(take.dir / "surface.pc2", take.surface);
  take.performance.surface = &reader;
  const std::filesystem::path path = take.dir / "out.glb";
  for (auto _ : state) WriteGltfPerformance(path, take.source, take.rig, take.performance);
  state.counters["MB"] = static_cast<double>(std::filesystem::file_size(path)) * 1e-6;
}
BENCHMARK(WriteGltfSurface)->Unit(benchmark::kMillisecond);

// A dense target per frame, surface less bind, with neither skinning nor animation: far less work, and
// nothing that a viewer which skins could show.
void WriteGltfSurface_BaselineTinygltfDense(benchmark::State& state) {
  const Take take;
  const std::filesystem::path path = take.dir / "out.glb";
  for (auto _ : state) {
    tinygltf::Model model = Load(take.source);
    std::vector<unsigned char>& bytes = model.buffers[0].data;
    for (const Eigen::Matrix3Xf& positions : take.surface) {
      const Eigen::Matrix3Xf offsets = positions - take.rig.meshes[0].mesh.positions;
      const auto* data = reinterpret_cast<const unsigned char*>(offsets.data());
      tinygltf::BufferView view;
      view.buffer = 0;
      view.byteOffset = bytes.size();
      view.byteLength = static_cast<size_t>(offsets.size()) * sizeof(float);
      bytes.insert(bytes.end(), data, data + view.byteLength);
      tinygltf::Accessor accessor;
      accessor.bufferView = static_cast<int>(model.bufferViews.size());
      accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
      accessor.type = TINYGLTF_TYPE_VEC3;
      accessor.count = static_cast<size_t>(offsets.cols());
      model.bufferViews.push_back(std::move(view));
      model.meshes[0].primitives[0].targets.push_back(
          {{"POSITION", static_cast<int>(model.accessors.size())}});
      model.accessors.push_back(std::move(accessor));
    }
    tinygltf::TinyGLTF().WriteGltfSceneToFile(&model, path.string(), false, true, false, true);
  }
  state.counters["MB"] = static_cast<double>(std::filesystem::file_size(path)) * 1e-6;
}
BENCHMARK(WriteGltfSurface_BaselineTinygltfDense)->Unit(benchmark::kMillisecond);

std::vector<Eigen::Matrix3Xf> Vertices() {
  return std::vector<Eigen::Matrix3Xf>(kFrames, Eigen::Matrix3Xf::Random(3, 13000));
}

void WritePc2(benchmark::State& state) {
  const testing::TempDir dir;
  const std::vector<Eigen::Matrix3Xf> frames = Vertices();
  for (auto _ : state) testing::WriteSurface(dir / "a.pc2", frames);
}
BENCHMARK(WritePc2)->Unit(benchmark::kMillisecond);

// One number after the other.
void WritePc2_BaselineNumberByNumber(benchmark::State& state) {
  const testing::TempDir dir;
  const std::vector<Eigen::Matrix3Xf> frames = Vertices();
  for (auto _ : state) {
    std::ofstream file(dir / "a.pc2", std::ios::binary);
    for (const Eigen::Matrix3Xf& frame : frames) {
      for (const float x : frame.reshaped()) file.write(reinterpret_cast<const char*>(&x), 4);
    }
  }
}
BENCHMARK(WritePc2_BaselineNumberByNumber)->Unit(benchmark::kMillisecond);

void ReadPc2(benchmark::State& state) {
  const testing::TempDir dir;
  testing::WriteSurface(dir / "a.pc2", Vertices());
  Eigen::Matrix3Xf positions;
  for (auto _ : state) {
    Pc2Reader reader(dir / "a.pc2");
    for (int f = 0; f < reader.num_frames(); ++f) reader.Read(f, &positions);
  }
}
BENCHMARK(ReadPc2)->Unit(benchmark::kMillisecond);

void ReadPc2_BaselineNumberByNumber(benchmark::State& state) {
  const testing::TempDir dir;
  testing::WriteSurface(dir / "a.pc2", Vertices());
  Eigen::Matrix3Xf positions(3, 13000);
  for (auto _ : state) {
    std::ifstream file(dir / "a.pc2", std::ios::binary);
    file.seekg(32);
    for (int f = 0; f < kFrames; ++f) {
      for (float& x : positions.reshaped()) file.read(reinterpret_cast<char*>(&x), 4);
    }
  }
}
BENCHMARK(ReadPc2_BaselineNumberByNumber)->Unit(benchmark::kMillisecond);

cv::Mat Mask() {
  cv::Mat mask = cv::Mat::zeros(720, 1280, CV_8UC1);
  cv::ellipse(mask, {600, 360}, {150, 300}, 20, 0, 360, 255, cv::FILLED);
  return mask;
}

void WriteMask720p(benchmark::State& state) {
  const testing::TempDir dir;
  const cv::Mat mask = Mask();
  MaskFolderWriter writer(dir / "masks");
  for (auto _ : state) writer.Write(mask);
}
BENCHMARK(WriteMask720p)->Unit(benchmark::kMillisecond)->Iterations(50);

void WriteMask720p_BaselineImwrite(benchmark::State& state) {
  const testing::TempDir dir;
  const cv::Mat mask = Mask();
  int frame = 0;
  for (auto _ : state) cv::imwrite((dir / (std::to_string(frame++) + ".png")).string(), mask);
}
BENCHMARK(WriteMask720p_BaselineImwrite)->Unit(benchmark::kMillisecond)->Iterations(50);

// A textured picture that moves.
std::vector<cv::Mat> Pictures() {
  cv::Mat wide(720, 1280 + 8 * kFrames, CV_8UC3);
  cv::setRNGSeed(1);
  cv::randu(wide, 0, 256);
  cv::GaussianBlur(wide, wide, {}, 3);
  std::vector<cv::Mat> pictures;
  for (int f = 0; f < kFrames; ++f) pictures.push_back(wide(cv::Rect(8 * f, 0, 1280, 720)));
  return pictures;
}

std::filesystem::path WriteClip(const testing::TempDir& dir) {
  const std::filesystem::path path = dir / "clip.mp4";
  VideoWriter writer(path, 1280, 720, 30);
  for (const cv::Mat& picture : Pictures()) writer.Write(picture);
  writer.Close();
  return path;
}

// Processor time of all of the encoder's threads.
void WriteVideo720p(benchmark::State& state, VideoEffort effort) {
  const testing::TempDir dir;
  const std::vector<cv::Mat> pictures = Pictures();
  for (auto _ : state) {
    VideoWriter writer(dir / "clip.mp4", 1280, 720, 30, effort);
    for (const cv::Mat& picture : pictures) writer.Write(picture);
    writer.Close();
  }
}
void WriteVideo720p_Usual(benchmark::State& state) { WriteVideo720p(state, VideoEffort::kUsual); }
BENCHMARK(WriteVideo720p_Usual)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
void WriteVideo720p_Low(benchmark::State& state) { WriteVideo720p(state, VideoEffort::kLow); }
BENCHMARK(WriteVideo720p_Low)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

void WriteByOpenCv(benchmark::State& state) {
  const testing::TempDir dir;
  const std::vector<cv::Mat> pictures = Pictures();
  const int h264 = cv::VideoWriter::fourcc('a', 'v', 'c', '1');
  for (auto _ : state) {
    cv::VideoWriter writer((dir / "clip.mp4").string(), h264, 30, {1280, 720});
    for (const cv::Mat& picture : pictures) writer.write(picture);
  }
}
void WriteVideo720p_Usual_BaselineVideoWriter(benchmark::State& state) { WriteByOpenCv(state); }
BENCHMARK(WriteVideo720p_Usual_BaselineVideoWriter)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();
void WriteVideo720p_Low_BaselineVideoWriter(benchmark::State& state) { WriteByOpenCv(state); }
BENCHMARK(WriteVideo720p_Low_BaselineVideoWriter)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void ReadVideo720p(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteClip(dir);
  cv::Mat bgr;
  for (auto _ : state) {
    VideoReader reader(path);
    while (reader.Read(&bgr)) benchmark::DoNotOptimize(bgr.data);
  }
}
BENCHMARK(ReadVideo720p)->Unit(benchmark::kMillisecond);

void ReadVideo720p_BaselineVideoCapture(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteClip(dir);
  cv::Mat bgr;
  for (auto _ : state) {
    cv::VideoCapture reader(path.string());
    while (reader.read(bgr)) benchmark::DoNotOptimize(bgr.data);
  }
}
BENCHMARK(ReadVideo720p_BaselineVideoCapture)->Unit(benchmark::kMillisecond);

// A motion capture file of 600 frames.
std::filesystem::path WriteMotion(const testing::TempDir& dir) {
  const Skeleton skeleton = DefaultSkeleton();
  WriteBvh(dir / "a.bvh", BvhFromPoses(skeleton, testing::RandomMotion(skeleton, 600, 5), 30));
  return dir / "a.bvh";
}

void ReadBvhMotion(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteMotion(dir);
  for (auto _ : state) benchmark::DoNotOptimize(ReadBvh(path));
}
BENCHMARK(ReadBvhMotion)->Unit(benchmark::kMillisecond);

// The numbers alone, by operator>>; words are skipped.
void ReadBvhMotion_BaselineStream(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteMotion(dir);
  for (auto _ : state) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line) && !line.starts_with("Frame Time");) {
    }
    double sum = 0;
    for (double value = 0; file >> value;) sum += value;
    benchmark::DoNotOptimize(sum);
  }
}
BENCHMARK(ReadBvhMotion_BaselineStream)->Unit(benchmark::kMillisecond);

// 3000 frames with the 16 joints.
std::filesystem::path WriteJoints(const testing::TempDir& dir) {
  Detections2d detections;
  for (int j = 0; j < 16; ++j) detections.joints.push_back(static_cast<JointId>(j));
  detections.frames.resize(3000);
  for (Detections2d::Frame& frame : detections.frames) {
    frame.pixels = 500 * Eigen::Matrix2Xd::Random(2, 16);
    frame.confidence = Eigen::VectorXd::Constant(16, 0.9);
  }
  WriteDetections(dir / "d.json", detections);
  return dir / "d.json";
}

void ReadJoints(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteJoints(dir);
  for (auto _ : state) benchmark::DoNotOptimize(ReadDetections2d(path));
}
BENCHMARK(ReadJoints)->Unit(benchmark::kMillisecond);

// Parsing alone.
void ReadJoints_BaselineJson(benchmark::State& state) {
  const testing::TempDir dir;
  const std::filesystem::path path = WriteJoints(dir);
  for (auto _ : state) {
    std::ifstream file(path);
    benchmark::DoNotOptimize(nlohmann::json::parse(file));
  }
}
BENCHMARK(ReadJoints_BaselineJson)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
