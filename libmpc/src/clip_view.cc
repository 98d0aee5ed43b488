#include "clip_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "mpc/seg/mask_bounds.h"

namespace mpc::internal {
namespace {

constexpr double kNearest = 0.1;  // metres
constexpr int kMinSide = 128;     // of a halved picture
constexpr double kOutlineSigmaPx = 1;
constexpr int kBlurPx = 5;
constexpr double kSmallFrames = 0.1;  // share of frames in which the actor may be smaller

// How tall the actor would stand in the pictures where it is farthest, but for few frames.
double ActorHeightPx(const PosedClip& clip) {
  const Eigen::Matrix3Xf& rest = clip.character.mesh.positions;
  if (rest.cols() == 0 || clip.poses.cols() == 0) return 0;
  const double height = (rest.rowwise().maxCoeff() - rest.rowwise().minCoeff()).maxCoeff();
  std::vector<double> depths;
  for (Eigen::Index f = 0; f < clip.poses.cols(); ++f) {
    depths.push_back(std::max(clip.poses(2, f), kNearest));
  }
  const auto few = static_cast<std::ptrdiff_t>(kSmallFrames * static_cast<double>(depths.size()));
  const auto far = depths.end() - 1 - few;
  std::nth_element(depths.begin(), far, depths.end());
  return std::min(clip.camera.fx, clip.camera.fy) * height / *far;
}

}  // namespace

ClipView::ClipView(const PosedClip& clip, double person_px)
    : camera(clip.camera), person_masks(clip.person_masks.begin(), clip.person_masks.end()) {
  if (person_px <= 0) return;
  const int side = std::min(camera.width, camera.height);
  double height = ActorHeightPx(clip);
  while ((height /= 2) > person_px && side >> (num_halvings + 1) >= kMinSide) ++num_halvings;
  if (num_halvings == 0) return;
  camera = clip.camera.ScaledTo(camera.width >> num_halvings, camera.height >> num_halvings);
  const Eigen::Array2d scale(camera.fx / clip.camera.fx, camera.fy / clip.camera.fy);
  for (PersonMask& mask : person_masks) {
    mask.region.center = (mask.region.center.array() + 0.5) * scale - 0.5;
    mask.region.size_px *= scale.mean();
  }
}

cv::Mat ClipView::Look(const cv::Mat& picture) const {
  if (num_halvings == 0) return picture;
  cv::Mat small;
  cv::resize(picture, small, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  return small;
}

cv::Mat EnlargedMask(const cv::Mat& mask, const cv::Size& size) {
  if (mask.size() == size) return mask;
  // Only around the actor, where the pixels of one size are whole blocks of the other's.
  const int scale = size.width / mask.cols;
  cv::Rect from({}, mask.size()), to({}, size);
  if (from.size() * scale == size) {
    from = Grown(MaskBounds(mask), kBlurPx / 2 + 1, mask.size());
    to = {from.tl() * scale, from.size() * scale};
  }
  cv::Mat large(size, CV_8U, cv::Scalar(0));
  if (from.empty()) return large;
  // Blurred first: the outline lies where it is half inside, between the pixels.
  cv::Mat near = large(to), smooth;
  cv::GaussianBlur(mask(from), smooth, {kBlurPx, kBlurPx}, kOutlineSigmaPx);
  cv::resize(smooth, smooth, near.size(), 0, 0, cv::INTER_LINEAR);
  cv::compare(smooth, 127, near, cv::CMP_GT);
  return large;
}

}  // namespace mpc::internal
