// Purpose: video in and out, frame by frame.
// Units: seconds, pixels. Frames are BGR, 8 bit, upright: rotation metadata is honoured.
//
// The frame rate must be constant: a frame that comes more than half a frame early or late after
// the one before ends reading with Error (kUnsupported), which names the frame and the cure.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

namespace mpc {

// Reads a video file, or a folder of numbered pictures (jpg, png, bmp, tif; in the order of their
// names), for which `image_fps` must be given. Not thread-safe; use one object per thread.
class VideoReader {
 public:
  // Throws Error: kFileNotFound; kBadFile when it is no video or its first frame cannot be decoded;
  // kInvalidArgument for a folder without image_fps.
  explicit VideoReader(const std::filesystem::path& path, double image_fps = 0);
  ~VideoReader();
  VideoReader(VideoReader&&) noexcept;
  VideoReader& operator=(VideoReader&&) noexcept;

  int width() const;
  int height() const;
  double fps() const;
  int num_frames() const;  // as the file says; -1 if it does not say

  // The next frame; false after the last. `bgr` may be reused from call to call. Throws Error:
  // kBadFile when the file ends more than 1 % (at least 2 frames) before its stated end or the
  // size changes; kUnsupported for a variable frame rate.
  bool Read(cv::Mat* bgr);

  // Passes over the next frame for less than it costs to read it; false after the last. Throws Error
  // as Read, but does not see the size change.
  bool Skip();

  // Of the frame read or passed over last: its index, and its time in the file.
  int frame_index() const;
  double frame_time_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

enum class VideoEffort {
  kLow,  // files a third larger, of a restless picture three times, made in half of the time
  kUsual,
};

// Writes H.264, yuv420p, .mp4. The file appears at `path` complete, by Close(), or not at all.
class VideoWriter {
 public:
  // An odd width or height is padded by one pixel, as the format needs. Throws Error
  // (kInvalidArgument for sizes or fps, kWriteFailed for the folder, kUnsupported without an
  // encoder).
  VideoWriter(const std::filesystem::path& path, int width, int height, double fps,
              VideoEffort effort = VideoEffort::kUsual);
  ~VideoWriter();
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) noexcept;

  // Throws Error: kInvalidArgument for another size or type than 8-bit BGR or grey, kWriteFailed.
  void Write(const cv::Mat& picture);

  // Finishes the file and moves it to its place. Throws Error (kWriteFailed).
  void Close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mpc
