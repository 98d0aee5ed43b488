#include "picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr int kMaxSide = 16384;

}  // namespace

void CheckPicture(const cv::Mat& picture, const char* name) {
  if (picture.empty() || picture.dims != 2) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("segmentation: {} is empty", name));
  }
  const int channels = picture.channels();
  if ((picture.depth() != CV_8U && picture.depth() != CV_16U) ||
      (channels != 1 && channels != 3 && channels != 4)) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("segmentation: {} is {}, expected 8 or 16 bits and 1, 3 or 4 channels",
                            name, cv::typeToString(picture.type())));
  }
  if (std::max(picture.cols, picture.rows) > kMaxSide) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("segmentation: {} is {}x{}, expected sides of at most {} px", name,
                            picture.cols, picture.rows, kMaxSide));
  }
}

void CheckMask(const cv::Mat& mask, const cv::Size& size, const char* name) {
  if (mask.empty() || mask.dims != 2 || mask.type() != CV_8UC1) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("segmentation: {} is {}, expected one channel of 8 bits", name,
                            mask.empty() ? "empty" : cv::typeToString(mask.type())));
  }
  if (mask.size() != size) {
    throw Error(ErrorCode::kMismatch, fmt::format("segmentation: {} is {}x{}, expected {}x{}", name,
                                                  mask.cols, mask.rows, size.width, size.height));
  }
}

cv::Mat ToBgr8(const cv::Mat& picture) {
  cv::Mat bytes = picture;
  if (picture.depth() == CV_16U) picture.convertTo(bytes, CV_8U, 1.0 / 257);
  cv::Mat bgr = bytes;
  if (bytes.channels() == 1) cv::cvtColor(bytes, bgr, cv::COLOR_GRAY2BGR);
  if (bytes.channels() == 4) cv::cvtColor(bytes, bgr, cv::COLOR_BGRA2BGR);
  return bgr;
}

cv::Mat Crop(const cv::Mat& picture, const cv::Rect& area) {
  const cv::Rect inside = area & cv::Rect({}, picture.size());
  if (inside == area) return picture(area);
  cv::Mat padded;
  cv::copyMakeBorder(picture(inside), padded, 0, area.height - inside.height, 0,
                     area.width - inside.width, cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  return padded;
}

cv::Mat Halved(const cv::Mat& picture) {
  const cv::Size size(picture.cols / 2, picture.rows / 2);
  cv::Mat half;
  cv::resize(picture(cv::Rect(0, 0, 2 * size.width, 2 * size.height)), half, size, 0, 0,
             cv::INTER_AREA);
  return half;
}

}  // namespace mpc
