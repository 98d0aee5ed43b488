#include "mpc/io/mask_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <string_view>
#include <system_error>

#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

constexpr size_t kNumDigits = 6;

void CheckMask(const fs::path& path, const cv::Mat& mask) {
  if (mask.type() == CV_8UC1 && !mask.empty()) return;
  throw Error(ErrorCode::kInvalidArgument,
              fmt::format("{}: a mask of {} x {} and type {}, expected 8-bit, one channel",
                          path.string(), mask.cols, mask.rows, mask.type()));
}

// 000000.png and the like.
bool IsPictureName(const fs::path& path) {
  const std::string stem = path.stem().string();
  return path.extension() == ".png" && stem.size() >= kNumDigits &&
         std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c); });
}

void RemovePictures(const fs::path& folder) {
  std::error_code ec;
  std::vector<fs::path> old;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ec)) {
    if (IsPictureName(entry.path())) old.push_back(entry.path());
  }
  for (const fs::path& path : old) fs::remove(path, ec);
}

}  // namespace

MaskReader::MaskReader(const fs::path& path, int width, int height)
    : path_(path), width_(width), height_(height), video_(path, /*image_fps=*/1) {
  std::error_code ec;
  is_video_ = !fs::is_directory(path, ec);
  const auto fits = [this](int have, int want) {
    return have == want || (is_video_ && have == (want + 1) / 2 * 2);
  };
  if (fits(video_.width(), width) && fits(video_.height(), height)) return;
  throw Error(ErrorCode::kMismatch,
              fmt::format("{} has masks of {} x {}, the clip is {} x {}", path.string(),
                          video_.width(), video_.height(), width, height));
}

bool MaskReader::Read(cv::Mat* mask) {
  if (!video_.Read(&bgr_)) return false;
  const cv::Mat picture = bgr_(cv::Rect(0, 0, width_, height_));
  double largest = 255;
  if (!is_video_) cv::minMaxLoc(picture.reshape(1), nullptr, &largest);
  cv::inRange(picture, cv::Scalar::all(0), cv::Scalar::all(largest > 127 ? 127 : 0), *mask);
  cv::bitwise_not(*mask, *mask);
  return true;
}

MaskVideoWriter::MaskVideoWriter(const fs::path& path, int width, int height, double fps)
    : video_(path, width, height, fps, VideoEffort::kLow) {}

void MaskVideoWriter::Write(const cv::Mat& mask) {
  CheckMask("masks", mask);
  video_.Write(mask);
}

PictureFolderWriter::PictureFolderWriter(const fs::path& folder) : folder_(folder) {
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (!fs::is_directory(folder, ec)) {
    throw Error(ErrorCode::kWriteFailed,
                fmt::format("{} is not a folder and cannot be made one", folder.string()));
  }
  RemovePictures(folder);
}

PictureFolderWriter::~PictureFolderWriter() {
  if (closed_) return;
  RemovePictures(folder_);
  std::error_code ec;
  fs::remove(folder_, ec);  // does nothing when other files are in it
}

void PictureFolderWriter::Write(const cv::Mat& picture) {
  const fs::path path = folder_ / fmt::format("{:0{}}.png", num_frames_, kNumDigits);
  const bool is_mask = picture.type() == CV_8UC1;
  if (picture.empty() || (!is_mask && picture.type() != CV_8UC3)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: a picture of {} x {} and type {}, expected 8-bit BGR",
                            path.string(), picture.cols, picture.rows, picture.type()));
  }
  std::vector<int> parameters;
  if (is_mask) parameters = {cv::IMWRITE_PNG_BILEVEL, 1};
  std::vector<unsigned char> bytes;
  cv::imencode(".png", picture, bytes, parameters);
  WriteFileAtomically(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  ++num_frames_;
}

void MaskFolderWriter::Write(const cv::Mat& mask) {
  CheckMask(folder_, mask);
  writer_.Write(mask);
}

}  // namespace mpc
