// Purpose: the noise of a camera's sensor.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace mpc {

// Adds white Gaussian noise of standard deviation `sigma` to every channel of a CV_8UC3 picture.
// Same seed and frame, same bytes.
void AddSensorNoise(double sigma, uint64_t seed, int frame, cv::Mat* bgr);

}  // namespace mpc
