// Networks with the same inputs and outputs as ONNX files, made here: their outputs are constants.
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/detect/pose_landmarker.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

// Protocol buffers' wire format, as much as a small ONNX file needs.
class Message {
 public:
  Message& Number(int field, std::uint64_t value) {
    Varint(static_cast<std::uint64_t>(field) << 3);
    Varint(value);
    return *this;
  }
  Message& Text(int field, const std::string& bytes) {
    Varint((static_cast<std::uint64_t>(field) << 3) | 2);
    Varint(bytes.size());
    bytes_ += bytes;
    return *this;
  }
  Message& Add(int field, const Message& message) { return Text(field, message.bytes_); }
  const std::string& bytes() const { return bytes_; }

 private:
  void Varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) bytes_ += static_cast<char>(value | 0x80);
    bytes_ += static_cast<char>(value);
  }
  std::string bytes_;
};

using Shape = std::vector<std::uint64_t>;

Message ValueInfo(const std::string& name, const Shape& shape) {
  Message dims;
  for (const std::uint64_t size : shape) dims.Add(1, Message().Number(1, size));
  const Message type = Message().Number(1, 1).Add(2, dims);  // floats
  return Message().Text(1, name).Add(2, Message().Add(1, type));
}

Message Tensor(const std::string& name, const Shape& shape, const std::vector<float>& values) {
  Message tensor;
  for (const std::uint64_t size : shape) tensor.Number(1, size);
  tensor.Number(2, 1).Text(8, name);
  return tensor.Text(9, {reinterpret_cast<const char*>(values.data()), 4 * values.size()});
}

Message IntTensor(const std::string& name, const std::vector<std::int64_t>& values) {
  Message tensor;
  tensor.Number(1, values.size()).Number(2, 7).Text(8, name);
  return tensor.Text(9, {reinterpret_cast<const char*>(values.data()), 8 * values.size()});
}

Message Node(const std::string& type, const std::vector<std::string>& inputs,
             const std::string& output) {
  Message node;
  for (const std::string& input : inputs) node.Text(1, input);
  return node.Text(2, output).Text(3, output).Text(4, type);
}

// A network that takes a picture, height x width x channels as converters from TensorFlow do, and
// gives `outputs` whatever it shows.
class OnnxWriter {
 public:
  explicit OnnxWriter(std::uint64_t side) {
    Message order = Message().Text(1, "perm");
    for (const std::uint64_t axis : {0, 3, 1, 2}) order.Number(8, axis);
    graph_.Add(1, Node("Transpose", {"picture"}, "planes").Add(5, order.Number(20, 7)));
    graph_.Add(1, Node("GlobalAveragePool", {"planes"}, "means"));
    graph_.Text(2, "graph").Add(11, ValueInfo("picture", {1, side, side, 3}));
  }
  void Output(const std::string& name, const Shape& shape, const std::vector<float>& values) {
    const std::uint64_t count = values.size();
    graph_.Add(5, Tensor(name + "_w", {count, 3, 1, 1}, std::vector<float>(3 * count)));
    graph_.Add(5, Tensor(name + "_b", {count}, values));
    graph_.Add(5, IntTensor(name + "_shape", {shape.begin(), shape.end()}));
    const Message kernel =
        Message().Text(1, "kernel_shape").Number(8, 1).Number(8, 1).Number(20, 7);
    const Message conv = Node("Conv", {"means", name + "_w", name + "_b"}, name + "_flat");
    graph_.Add(1, Message(conv).Add(5, kernel));
    graph_.Add(1, Node("Reshape", {name + "_flat", name + "_shape"}, name));
    graph_.Add(12, ValueInfo(name, shape));
  }
  void Write(const std::filesystem::path& path) const {
    const Message model = Message().Number(1, 7).Add(7, graph_).Add(8, Message().Number(2, 11));
    std::ofstream(path, std::ios::binary) << model.bytes();
  }

 private:
  Message graph_;
};

TEST(Onnx, LandmarkNetworkOfTheSameInterface) {
  std::vector<float> points(195, 5.0f);  // visible and present
  for (size_t i = 0; i < 39; ++i) {
    points[5 * i] = 128 + static_cast<float>(i);
    points[5 * i + 1] = i == 34 ? 28 : 128;  // the reach, above the hips
  }
  points[5 * 33] = points[5 * 34] = 128;
  std::vector<float> world(117);
  world[3] = 0.25f;
  OnnxWriter model(256);
  model.Output("points", {1, 195}, points);
  model.Output("flag", {1, 1}, {0.9f});
  model.Output("mask", {1, 256, 256, 1}, std::vector<float>(65536, 2.0f));
  model.Output("heatmap", {1, 64, 64, 39}, std::vector<float>(159744, -9.0f));
  model.Output("world", {1, 117}, world);
  const testing::TempDir dir;
  model.Write(dir / "model.onnx");

  PoseLandmarker landmarker(Network::Read(dir / "model.onnx"));
  const cv::Mat picture(300, 300, CV_8UC3, cv::Scalar(10, 20, 30));
  const PersonPose pose = landmarker.Find(picture, {.center = {150, 160}, .size_px = 128});
  EXPECT_NEAR(pose.score, 0.9, 1e-6);
  EXPECT_TRUE(pose.pixels.col(0).isApprox(Eigen::Vector2d(150, 160), 1e-6));
  EXPECT_TRUE(pose.pixels.col(20).isApprox(Eigen::Vector2d(160, 160), 1e-6));
  EXPECT_NEAR(pose.world(0, 1), 0.25, 1e-6);
  EXPECT_NEAR(pose.refined.size_px, 2 * 1.25 * 50, 1e-6);
  EXPECT_NEAR(pose.mask.at<float>(9, 9), 1 / (1 + std::exp(-2.0)), 1e-6);
}

TEST(Onnx, AnotherNetworkIsRefused) {
  OnnxWriter model(256);
  model.Output("points", {1, 195}, std::vector<float>(195));
  const testing::TempDir dir;
  model.Write(dir / "model.onnx");
  PoseLandmarker landmarker(Network::Read(dir / "model.onnx"));
  const cv::Mat picture(300, 300, CV_8UC3, cv::Scalar(10, 20, 30));
  EXPECT_MPC_ERROR(landmarker.Find(picture, {.center = {150, 160}, .size_px = 128}), kUnsupported,
                   "no network for body landmarks");
}

}  // namespace
}  // namespace mpc
