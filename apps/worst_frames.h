// Purpose: the frames of a clip where a capture is farthest from the truth, as pictures.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "evaluation.h"

namespace monoperfcap {

struct FramePicture {
  int frame = 0;
  std::string caption;
  cv::Mat bgr;  // around the actor
};

// The worst few frames by IoU (outline of the captured mesh, and the true one where there are masks),
// then by MPJPE (stick figures of capture and truth), not near one another, in the video's order.
// Throws mpc::Error for a video that cannot be read or has another size or fewer frames.
std::vector<FramePicture> WorstFrames(const Performance& performance, const Truth& truth,
                                      const Evaluation& evaluation,
                                      const std::filesystem::path& video, double image_fps);

}  // namespace monoperfcap
