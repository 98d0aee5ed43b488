// Purpose: the silhouette of a posed actor in one frame, and how near it is to what is known.
// Source: paper, Section 5.1. Symbols: V vertices, M mask of the actor's mesh, R of its skeleton.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "background_view.h"
#include "clip_reader.h"
#include "clip_view.h"
#include "mpc/render/model_mask.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/limbs.h"

namespace mpc::internal {

// M of the actor in one of its poses.
cv::Mat PosedModelMask(const Character& character, const Camera& camera,
                       const SurfaceTopology& topology, const Eigen::VectorXd& pose);

class SilhouetteMaker {
 public:
  // The first three must outlive it.
  SilhouetteMaker(const PosedClip& clip, const ClipView& view, const SilhouetteOptions& options,
                  BackgroundView background);

  // M of a posed mesh (3xV, camera frame).
  void Model(const Eigen::Matrix3Xf& vertices, cv::Mat* mask) const;

  // The same in the clip's own pictures.
  cv::Mat WholeModel(const Eigen::Matrix3Xf& vertices) const;

  // The user's mask where there is one, else cut out of the picture. `model` is M, `earlier` the
  // silhouette cut before, if there is one.
  Silhouette Make(const KinematicState& state, const Eigen::Matrix3Xf& vertices,
                  const cv::Mat& model, const ClipFrame& frame,
                  const SegmentationOptions& segmentation, const cv::Mat& earlier = {}) const;

  // What is known of it, compared with a true mask of the clip's size unless that is empty.
  SilhouetteRecord Record(const Silhouette& silhouette, const Eigen::Matrix3Xf& vertices,
                          const cv::Mat& model, const cv::Mat& truth) const;

 private:
  double CutOffActorSizePx(const Eigen::Matrix3Xf& vertices) const;

  const PosedClip& clip_;
  const ClipView& view_;
  const SilhouetteOptions& options_;
  SurfaceTopology topology_;
  std::vector<Limb> limbs_;
  BackgroundView background_;
};

}  // namespace mpc::internal
