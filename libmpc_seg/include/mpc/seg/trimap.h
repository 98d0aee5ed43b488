// Purpose: the paper's automatic initialisation of GrabCut from the posed actor.
// Source: paper, Section 5.1, Eq. 9:
//   T_f = R u erosion(M)   T_b = not dilation(M)   T_uf = M - T_f   T_ub = dilation(M) - M
// Frames: pictures, pixel centres at integers. Units: pixels.
// Symbols: M mask of the actor's mesh, R mask of its skeleton, both CV_8U, nonzero inside.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace mpc {

// Values of a trimap's pixels: those of cv::GrabCutClasses.
enum TrimapLabel : uint8_t {
  kTrimapBackground = 0,         // T_b
  kTrimapForeground = 1,         // T_f
  kTrimapUnknownBackground = 2,  // T_ub
  kTrimapUnknownForeground = 3,  // T_uf
};

inline bool IsUnknown(uint8_t label) { return label >= kTrimapUnknownBackground; }

struct TrimapRadii {
  double erode_px = 0;  // radius of the disc, >= 0
  double dilate_px = 0;
};

// Size of an actor in the picture: the square root of the mask's area, px; 0 for an empty mask. It
// changes less with the pose than the height does (a standing person is 2 to 2.5 sizes tall).
double ActorSizePx(const cv::Mat& mask);

// The trimap as CV_8U of the masks' size. Erosion and dilation are by discs; what lies outside the
// picture is unknown: it neither erodes nor dilates. R may be empty (no skeleton). Pixels of R
// outside M are foreground too, as the equation says; clip R beforehand where that is not wanted.
// Throws Error (kInvalidArgument, kMismatch) for masks that are empty matrices, not CV_8U or of
// different sizes, and for radii that are negative or not finite.
cv::Mat MakeTrimap(const cv::Mat& skeleton_mask, const cv::Mat& model_mask,
                   const TrimapRadii& radii);

}  // namespace mpc
