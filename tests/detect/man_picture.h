// Purpose: a picture of a person, for tests that run the networks.
#pragma once

#include <opencv2/imgproc.hpp>
#include <string>

#include "mpc/io/video.h"
#include "support/data_dir.h"

namespace mpc::testing {

// The man in the first frame of cam01 or cam03, 400 x 500 pixels.
inline cv::Mat ManPicture(const std::string& name) {
  VideoReader video(*DataDir() / "pose2sim" / (name + ".mp4"));
  cv::Mat picture, small;
  video.Read(&picture);
  cv::resize(picture(cv::Rect(0, 250, 800, 1000)), small, {400, 500}, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace mpc::testing
