// Purpose: H.264 in an .mp4 by libavcodec's x264 at fast presets, which OpenCV's writer cannot ask
// for: its default takes longer than everything else that is done to a picture.
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

namespace mpc {

class H264Encoder {
 public:
  // Even sides; fast: the preset in which x264 decides least, every macroblock as coarse as the other,
  // so that it does not look at a frame before it encodes it. Every fault is a thrown
  // std::runtime_error with FFmpeg's words.
  H264Encoder(const std::string& path, int width, int height, double fps, bool fast);
  ~H264Encoder();

  // CV_8UC3, or CV_8UC1 for a grey picture.
  void Write(const cv::Mat& picture);

  // Writes what the encoder still holds and the file's index, and closes it.
  void Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mpc
