// Purpose: the size at which a clip is looked at: large pictures of a person cost much and tell little
// more than smaller ones.
// Source: ours, docs/segmentation.md. Units: pixels.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/detect/person_mask.h"
#include "mpc/silhouettes.h"

namespace mpc::internal {

struct ClipView {
  Camera camera;         // for the pictures as they are looked at
  int num_halvings = 0;  // of the clip's pictures
  std::vector<PersonMask> person_masks;

  // Pictures are halved as long as the actor stays taller than person_px in nine of ten frames, and
  // the pictures no smaller than 128 px; 0: never.
  explicit ClipView(const PosedClip& clip, double person_px = 0);

  // A picture of the clip as it is looked at; itself when it is not halved.
  cv::Mat Look(const cv::Mat& picture) const;
};

// A mask (CV_8UC1, 0 or 255) that was found at a smaller size, at the size of the clip's pictures.
cv::Mat EnlargedMask(const cv::Mat& mask, const cv::Size& size);

}  // namespace mpc::internal
