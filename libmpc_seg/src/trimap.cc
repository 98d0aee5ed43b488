#include "mpc/seg/trimap.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "mpc/core/error.h"
#include "picture.h"

namespace mpc {

double ActorSizePx(const cv::Mat& mask) {
  if (mask.empty()) return 0;
  CheckMask(mask, mask.size(), "mask");
  return std::sqrt(static_cast<double>(cv::countNonZero(mask)));
}

cv::Mat MakeTrimap(const cv::Mat& skeleton_mask, const cv::Mat& model_mask,
                   const TrimapRadii& radii) {
  CheckMask(model_mask, model_mask.size(), "model mask");
  if (!skeleton_mask.empty()) CheckMask(skeleton_mask, model_mask.size(), "skeleton mask");
  if (!(radii.erode_px >= 0 && radii.dilate_px >= 0 && std::isfinite(radii.erode_px) &&
        std::isfinite(radii.dilate_px))) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("trimap: radii {} and {} px, expected numbers that are not negative",
                            radii.erode_px, radii.dilate_px));
  }
  // A pixel survives erosion when no pixel outside M lies within the radius, and likewise for the
  // other side. Without any pixel on the other side the distance stays large.
  const cv::Mat inside = model_mask != 0;
  const cv::Mat outside = model_mask == 0;
  const bool has_inside = cv::countNonZero(inside) > 0;
  const bool has_outside = cv::countNonZero(outside) > 0;
  cv::Mat trimap(model_mask.size(), CV_8U, cv::Scalar(kTrimapBackground));
  if (has_inside) {
    cv::Mat to_inside;
    cv::distanceTransform(outside, to_inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    trimap.setTo(kTrimapUnknownBackground, to_inside <= radii.dilate_px);
  }
  trimap.setTo(kTrimapUnknownForeground, inside);
  if (has_outside) {
    cv::Mat to_outside;
    cv::distanceTransform(inside, to_outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    trimap.setTo(kTrimapForeground, to_outside > radii.erode_px);
  } else {
    trimap.setTo(kTrimapForeground);
  }
  if (!skeleton_mask.empty()) trimap.setTo(kTrimapForeground, skeleton_mask != 0);
  return trimap;
}

}  // namespace mpc
