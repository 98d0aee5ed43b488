#include "mpc/detect/network.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <fstream>
#include <iterator>
#include <opencv2/dnn.hpp>

#include "mpc/core/error.h"
#include "net_builder.h"
#include "tflite_reader.h"

namespace mpc {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 28;

std::vector<std::uint8_t> ReadBytes(const std::filesystem::path& path) {
  std::error_code ec;
  const std::uintmax_t size = std::filesystem::file_size(path, ec);
  std::ifstream file(path, std::ios::binary);
  if (ec || !file) {
    throw Error(ErrorCode::kFileNotFound, fmt::format("{} cannot be read", path.string()));
  }
  if (size > kMaxFileBytes) {
    throw Error(ErrorCode::kBadFile, fmt::format("{} has {} bytes, a network at most {}",
                                                 path.string(), size, kMaxFileBytes));
  }
  std::vector<std::uint8_t> bytes(size);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!file) throw Error(ErrorCode::kBadFile, fmt::format("{} ends early", path.string()));
  return bytes;
}

}  // namespace

struct Network::Impl {
  std::string name;
  cv::dnn::Net net;
  std::vector<std::string> outputs;
  int width = 0;  // 0: not known, OpenCV's importer of ONNX does not tell
  int height = 0;
  bool channels_last = false;  // of the input, in ONNX files made from TensorFlow

  std::vector<cv::Mat> Forward(const cv::Mat& blob) {
    cv::Mat input = blob;
    if (channels_last) cv::transposeND(blob, {0, 2, 3, 1}, input);
    std::vector<cv::Mat> results;
    net.setInput(input);
    net.forward(results, outputs);
    return results;
  }
};

namespace {

// OpenCV's importer prints its complaints; they are in the exception too.
cv::dnn::Net ImportOnnx(const std::vector<std::uint8_t>& bytes, const std::string& name) {
  try {
    return cv::dnn::readNetFromONNX(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  } catch (const cv::Exception& e) {
    throw Error(ErrorCode::kBadFile,
                fmt::format("{}: neither a TensorFlow Lite nor an ONNX network that OpenCV can "
                            "read ({})",
                            name, e.err));
  }
}

}  // namespace

Network::Network(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Network::~Network() = default;
Network::Network(Network&&) noexcept = default;
Network& Network::operator=(Network&&) noexcept = default;

Network Network::FromTflite(std::span<const std::uint8_t> bytes, const std::string& name) {
  internal::Graph graph = internal::ReadTflite(bytes, name);
  const std::vector<int> input = graph.tensors[static_cast<size_t>(graph.input)].shape;
  if (input[3] != 3) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{} takes a picture of {} channels, expected 3", name, input[3]));
  }
  auto impl = std::make_unique<Impl>();
  impl->name = name;
  impl->height = input[1];
  impl->width = input[2];
  internal::BuiltNet built = internal::BuildNet(std::move(graph));
  impl->net = built.net;
  impl->outputs = built.outputs;
  return Network(std::move(impl));
}

Network Network::Read(const std::filesystem::path& path) {
  const std::vector<std::uint8_t> bytes = ReadBytes(path);
  if (internal::IsTflite(bytes)) return FromTflite(bytes, path.string());
  auto impl = std::make_unique<Impl>();
  impl->name = path.string();
  impl->net = ImportOnnx(bytes, impl->name);
  impl->outputs = impl->net.getUnconnectedOutLayersNames();
  return Network(std::move(impl));
}

const std::string& Network::name() const { return impl_->name; }
int Network::input_width() const { return impl_->width; }
int Network::input_height() const { return impl_->height; }

std::vector<cv::Mat> Network::Run(const cv::Mat& blob) {
  const bool fits =
      blob.type() == CV_32F && blob.dims == 4 && blob.size[0] == 1 && blob.size[1] == 3 &&
      (impl_->width == 0 || (blob.size[2] == impl_->height && blob.size[3] == impl_->width));
  if (!fits) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("{} takes 1 x 3 x {} x {} floats",
                                                         impl_->name, impl_->height, impl_->width));
  }
  std::vector<cv::Mat> results, copies;
  try {
    results = impl_->Forward(blob);
  } catch (const cv::Exception&) {
    if (impl_->width != 0 || impl_->channels_last) throw;
    impl_->channels_last = true;  // the other order of axes, from now on
    try {
      results = impl_->Forward(blob);
    } catch (const cv::Exception& e) {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{} cannot take a picture of {}x{} ({})", impl_->name, blob.size[3],
                              blob.size[2], e.err));
    }
  }
  for (const cv::Mat& result : results) copies.push_back(result.clone());  // they share memory
  return copies;
}

}  // namespace mpc
