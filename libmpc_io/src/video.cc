#include "mpc/io/video.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <set>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "h264_encoder.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

// A frame's step in time may differ from 1 / fps by this fraction of it.
constexpr double kStepTolerance = 0.5;
constexpr double kMaxFps = 1000;

[[noreturn]] void ThrowBadFile(const fs::path& path, const std::string& fault) {
  throw Error(ErrorCode::kBadFile, fmt::format("{}: {}", path.string(), fault));
}

std::vector<fs::path> PicturesIn(const fs::path& folder) {
  static const std::set<std::string> kExtensions = {".jpg", ".jpeg", ".png",
                                                    ".bmp", ".tif",  ".tiff"};
  std::vector<fs::path> pictures;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    std::string extension = entry.path().extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (kExtensions.contains(extension)) pictures.push_back(entry.path());
  }
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

}  // namespace

struct VideoReader::Impl {
  fs::path path;
  cv::VideoCapture capture;
  std::vector<fs::path> pictures;  // instead of the capture
  cv::Mat first;                   // decoded when the file was opened
  double first_time_s = 0;
  int width = 0;
  int height = 0;
  double fps = 0;
  int num_frames = -1;
  int index = -1;
  double time_s = 0;

  // The next frame in the file and its time; false after the last. frame null: it is decoded, but not
  // made BGR.
  bool Decode(cv::Mat* frame, double* decoded_time_s) {
    try {
      if (!pictures.empty()) {
        const size_t next = static_cast<size_t>(index) + 1;
        if (next >= pictures.size()) return false;
        *decoded_time_s = static_cast<double>(next) / fps;
        const cv::Mat picture = cv::imread(pictures[next].string(), cv::IMREAD_COLOR);
        if (picture.empty()) ThrowBadFile(pictures[next], "not a readable picture");
        if (frame != nullptr) *frame = picture;
        return true;
      }
      if (!capture.grab()) return false;
      if (frame != nullptr) capture.retrieve(*frame);
      *decoded_time_s = capture.get(cv::CAP_PROP_POS_MSEC) / 1000;
      // The last frames, drained from the decoder, come without a time of their own.
      if (index >= 0 && *decoded_time_s <= 0) *decoded_time_s = time_s + 1 / fps;
    } catch (const cv::Exception& e) {
      ThrowBadFile(path, fmt::format("frame {} cannot be decoded: {}", index + 1, e.what()));
    }
    return frame == nullptr || !frame->empty();
  }

  // Goes on by a frame; false after the last.
  bool Next(cv::Mat* frame) {
    double next_time_s = first_time_s;
    if (index < 0) {
      if (frame != nullptr) *frame = first;
      first.release();
    } else if (!Decode(frame, &next_time_s)) {
      CheckEnd();
      return false;
    }
    ++index;
    if (index > 0) CheckStep(next_time_s - time_s);
    time_s = next_time_s;
    return true;
  }

  void CheckEnd() const {
    if (num_frames < 0) return;
    const int missing = num_frames - (index + 1);
    if (missing > std::max(2, num_frames / 100)) {
      ThrowBadFile(
          path, fmt::format("the video breaks off after {} of {} frames", index + 1, num_frames));
    }
  }

  void CheckStep(double step_s) const {
    if (std::abs(step_s * fps - 1) <= kStepTolerance) return;
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: variable frame rate: frame {} comes {:.1f} ms after frame {}, "
                            "expected {:.1f} ms; make the rate constant first: ffmpeg -i INPUT "
                            "-vsync cfr OUTPUT.mp4",
                            path.string(), index, 1000 * step_s, index - 1, 1000 / fps));
  }
};

VideoReader::VideoReader(const fs::path& path, double image_fps) : impl_(new Impl) {
  impl_->path = path;
  std::error_code ec;
  if (!fs::exists(path, ec)) {
    throw Error(ErrorCode::kFileNotFound, fmt::format("there is no file {}", path.string()));
  }
  if (fs::is_directory(path, ec)) {
    impl_->pictures = PicturesIn(path);
    if (impl_->pictures.empty()) ThrowBadFile(path, "the folder holds no pictures");
    impl_->fps = image_fps;
    impl_->num_frames = static_cast<int>(impl_->pictures.size());
    if (!(image_fps > 0)) {
      throw Error(
          ErrorCode::kInvalidArgument,
          fmt::format("{} is a folder of pictures: its frame rate must be given", path.string()));
    }
  } else {
    impl_->capture.open(path.string(), cv::CAP_FFMPEG);
    if (!impl_->capture.isOpened()) ThrowBadFile(path, "not a readable video");
    impl_->capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 1);
    impl_->fps = impl_->capture.get(cv::CAP_PROP_FPS);
    const double count = impl_->capture.get(cv::CAP_PROP_FRAME_COUNT);
    if (count >= 1 && count < 1e9) impl_->num_frames = static_cast<int>(count);
  }
  if (!(impl_->fps > 0) || impl_->fps > kMaxFps) {
    ThrowBadFile(path, fmt::format("{} frames per second", impl_->fps));
  }
  if (!impl_->Decode(&impl_->first, &impl_->first_time_s)) {
    ThrowBadFile(path, "no frame can be decoded");
  }
  impl_->width = impl_->first.cols;
  impl_->height = impl_->first.rows;
}

VideoReader::~VideoReader() = default;
VideoReader::VideoReader(VideoReader&&) noexcept = default;
VideoReader& VideoReader::operator=(VideoReader&&) noexcept = default;

int VideoReader::width() const { return impl_->width; }
int VideoReader::height() const { return impl_->height; }
double VideoReader::fps() const { return impl_->fps; }
int VideoReader::num_frames() const { return impl_->num_frames; }
int VideoReader::frame_index() const { return impl_->index; }
double VideoReader::frame_time_s() const { return impl_->time_s; }

bool VideoReader::Skip() { return impl_->Next(nullptr); }

bool VideoReader::Read(cv::Mat* bgr) {
  cv::Mat frame;
  if (!impl_->Next(&frame)) return false;
  if (frame.cols != impl_->width || frame.rows != impl_->height || frame.type() != CV_8UC3) {
    ThrowBadFile(impl_->path, fmt::format("frame {} is {} x {}, the first is {} x {}", impl_->index,
                                          frame.cols, frame.rows, impl_->width, impl_->height));
  }
  *bgr = std::move(frame);
  return true;
}

struct VideoWriter::Impl {
  Impl(const fs::path& target, int frame_width, int frame_height)
      : path(target), width(frame_width), height(frame_height), file(target) {}

  fs::path path;
  int width;
  int height;
  int num_frames = 0;
  AtomicFile file;  // before the encoder, which must let go of the file first
  std::optional<H264Encoder> encoder;
  cv::Mat padded;

  // What the encoder does.
  template <typename Work>
  void Encode(const Work& work) {
    try {
      work();
    } catch (const std::runtime_error& e) {
      throw Error(ErrorCode::kWriteFailed,
                  fmt::format("cannot write {}: {}", path.string(), e.what()));
    }
  }
};

VideoWriter::VideoWriter(const fs::path& path, int width, int height, double fps,
                         VideoEffort effort) {
  if (width < 1 || height < 1 || !(fps > 0) || fps > kMaxFps) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: a video of {} x {} at {} frames per second", path.string(), width,
                            height, fps));
  }
  impl_ = std::make_unique<Impl>(path, width, height);
  WriteFileAtomically(impl_->file.temporary(), "");  // says why, where the encoder would not
  const cv::Size even_size((width + 1) / 2 * 2, (height + 1) / 2 * 2);
  try {
    impl_->encoder.emplace(impl_->file.temporary().string(), even_size.width, even_size.height, fps,
                           effort == VideoEffort::kLow);
  } catch (const std::runtime_error& e) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: no H.264 of {} x {} at {} frames per second: {}", path.string(),
                            even_size.width, even_size.height, fps, e.what()));
  }
}

VideoWriter::~VideoWriter() = default;
VideoWriter::VideoWriter(VideoWriter&&) noexcept = default;
VideoWriter& VideoWriter::operator=(VideoWriter&&) noexcept = default;

void VideoWriter::Write(const cv::Mat& picture) {
  if (picture.cols != impl_->width || picture.rows != impl_->height ||
      (picture.type() != CV_8UC3 && picture.type() != CV_8UC1)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: a frame of {} x {} and type {}, expected {} x {} BGR or grey",
                            impl_->path.string(), picture.cols, picture.rows, picture.type(),
                            impl_->width, impl_->height));
  }
  cv::Mat even = picture;
  if (impl_->width % 2 != 0 || impl_->height % 2 != 0) {
    cv::copyMakeBorder(picture, impl_->padded, 0, impl_->height % 2, 0, impl_->width % 2,
                       cv::BORDER_REPLICATE);
    even = impl_->padded;
  }
  impl_->Encode([&] { impl_->encoder->Write(even); });
  ++impl_->num_frames;
}

void VideoWriter::Close() {
  if (impl_->num_frames == 0) {
    throw Error(ErrorCode::kWriteFailed,
                fmt::format("cannot write {}: no frame was written", impl_->path.string()));
  }
  impl_->Encode([&] { impl_->encoder->Finish(); });
  impl_->file.Commit();
}

}  // namespace mpc
