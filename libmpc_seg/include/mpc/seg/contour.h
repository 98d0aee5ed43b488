// Purpose: the outline of a silhouette with sub-pixel positions and outward normals, what pose and
// surface refinement compare the model with.
// Source: paper, Section 5.2 (image silhouette with normals); the sub-pixel step is ours.
// Frames: pictures, pixel centres at integers, y down. Units: pixels.
#pragma once

#include <opencv2/core.hpp>

#include "mpc/core/contour2d.h"

namespace mpc {

// One point per pair of 4-neighbours of which one is inside, in row order. The border of the
// picture is not part of the outline: what the picture cuts off has no outline there. Points move
// from between the two pixels to where a smoothed inside-ness is one half, by at most one pixel;
// normals are its gradient.
//
// mask: CV_8U, nonzero inside. soft: CV_8U (0..255) or CV_32F (0..1) inside-ness (alpha) of the
// same size, which places the points; empty: the mask itself, smoothed.
// Thread-safe. Throws Error for other types and sizes.
Contour2d ExtractContour(const cv::Mat& mask, const cv::Mat& soft = cv::Mat());

}  // namespace mpc
