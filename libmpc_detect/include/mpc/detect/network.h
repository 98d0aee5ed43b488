// Purpose: a neural network from a file, run on one picture at a time by OpenCV's DNN module.
// Source: TensorFlow Lite files with the operations of MediaPipe's pose networks; ONNX files.
// Units: pictures as 1 x 3 x height x width floats, RGB.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

namespace mpc {

// Not thread-safe: one object per thread. Runs on OpenCV's threads (cv::setNumThreads, which is
// global to the process); results do not depend on their number.
class Network {
 public:
  // The kind of file is found from its content. Throws Error: kFileNotFound; kBadFile for a broken
  // file, with the place; kUnsupported for operations or inputs that cannot be run.
  static Network Read(const std::filesystem::path& path);

  // A TensorFlow Lite network from its bytes; `name` stands in messages. Any bytes end in a network
  // or in Error, with memory below a fixed multiple of their number.
  static Network FromTflite(std::span<const std::uint8_t> bytes, const std::string& name);

  ~Network();
  Network(Network&&) noexcept;
  Network& operator=(Network&&) noexcept;

  const std::string& name() const;  // of the file
  int input_width() const;          // 0: an ONNX file, which does not say
  int input_height() const;

  // Outputs in the order of the file. Of a TFLite file a picture comes out as 1 x channels x height
  // x width. Throws Error (kInvalidArgument) for a blob of another shape or type.
  std::vector<cv::Mat> Run(const cv::Mat& blob);

 private:
  struct Impl;
  explicit Network(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mpc
