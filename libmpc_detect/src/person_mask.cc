#include "mpc/detect/person_mask.h"

#include <algorithm>

namespace mpc {

cv::Mat PictureMask(const PersonMask& mask, const cv::Size& size) {
  return PasteRegion(mask.probability, mask.region, size);
}

cv::Mat PictureMask(std::span<const PersonMask> masks, int frame, int max_gap,
                    const cv::Size& size) {
  const auto after = std::lower_bound(masks.begin(), masks.end(), frame,
                                      [](const PersonMask& mask, int f) { return mask.frame < f; });
  if (after == masks.end()) return {};
  if (after->frame == frame) return PictureMask(*after, size);
  if (after == masks.begin()) return {};
  const PersonMask& a = *std::prev(after);
  const PersonMask& b = *after;
  if (b.frame - a.frame > max_gap) return {};
  const double t = static_cast<double>(frame - a.frame) / (b.frame - a.frame);
  PersonMask between = {.frame = frame, .region = RegionBetween(a.region, b.region, t)};
  cv::addWeighted(a.probability, 1 - t, b.probability, t, 0, between.probability);
  return PictureMask(between, size);
}

}  // namespace mpc
