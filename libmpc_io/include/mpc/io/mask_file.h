// Purpose: masks of a clip, one per frame, as a video or as a folder of pictures; such folders.
// Units: pixels. Masks are CV_8UC1, 255 inside, 0 outside, of the clip's size.
//
// H.264 is not lossless: now and then a single pixel of a masks.mp4 comes back as its opposite
// (docs/formats.md). The pictures are exact.
#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "mpc/io/video.h"

namespace mpc {

// Reads a video, or a folder of pictures in the order of their names. Not thread-safe.
class MaskReader {
 public:
  // width, height: of the clip. A video may be padded by one pixel where a side is odd. Throws Error:
  // kFileNotFound, kBadFile, and kMismatch for masks of another size.
  MaskReader(const std::filesystem::path& path, int width, int height);

  int num_frames() const { return video_.num_frames(); }  // as the file says; -1 if it does not

  // The next mask; false after the last. Video: above 127 is inside. Pictures: above 127, or, where
  // nothing is above 127, what is not black. Throws Error (kBadFile).
  bool Read(cv::Mat* mask);

 private:
  std::filesystem::path path_;
  bool is_video_;
  int width_;
  int height_;
  VideoReader video_;
  cv::Mat bgr_;
};

// Writes masks as H.264, white on black. As VideoWriter: complete by Close(), or not there.
class MaskVideoWriter {
 public:
  MaskVideoWriter(const std::filesystem::path& path, int width, int height, double fps);

  // Throws Error (kInvalidArgument) for another size or type than CV_8UC1.
  void Write(const cv::Mat& mask);
  void Close() { video_.Close(); }

 private:
  VideoWriter video_;
};

// Writes pictures as 000000.png, 000001.png, ... into a folder, which is made when it is missing.
// Pictures with such names from an earlier run are removed first; without Close() so are the new
// ones.
class PictureFolderWriter {
 public:
  // Throws Error (kWriteFailed).
  explicit PictureFolderWriter(const std::filesystem::path& folder);
  ~PictureFolderWriter();
  PictureFolderWriter(const PictureFolderWriter&) = delete;
  PictureFolderWriter& operator=(const PictureFolderWriter&) = delete;

  // CV_8UC3, or CV_8UC1 for a mask, which takes one bit per pixel. Throws Error (kInvalidArgument
  // for another type, kWriteFailed).
  void Write(const cv::Mat& picture);
  void Close() { closed_ = true; }

 private:
  std::filesystem::path folder_;
  int num_frames_ = 0;
  bool closed_ = false;
};

// The same for masks only.
class MaskFolderWriter {
 public:
  explicit MaskFolderWriter(const std::filesystem::path& folder)
      : folder_(folder), writer_(folder) {}

  // Throws Error (kInvalidArgument for another type than CV_8UC1, kWriteFailed).
  void Write(const cv::Mat& mask);
  void Close() { writer_.Close(); }

 private:
  std::filesystem::path folder_;
  PictureFolderWriter writer_;
};

}  // namespace mpc
