// Purpose: how far estimated joints, pixels and masks are from the truth; the only place where the
// project computes these numbers.
// Source: MPJPE, PA-MPJPE, N-MPJPE as in the Human3.6M and MPI-INF-3DHP literature; similarity
// alignment after Umeyama 1991.
// Frames: any, the same for both inputs. Units: inputs metres and pixels, results mm and pixels.
// Symbols: J joints, F frames. Joint trajectories are 3J x F, joint i in rows 3i..3i+2.
//
// A joint with a NaN coordinate in either input is missing: it is skipped and counted, never
// guessed. All functions are pure and thread-safe, and throw Error (kMismatch) when sizes differ.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/joints.h"

namespace mpc {

// Distances after one kind of alignment.
struct AlignedError {
  std::string alignment;         // what was removed, such as "root translation"
  double mean_mm = 0;            // over all scored joints of all frames; NaN when there are none
  int num_frames = 0;            // frames with at least one scored joint
  int num_observations = 0;      // scored joints, summed over frames
  Eigen::VectorXd per_frame_mm;  // F; NaN for a frame that was not scored
  Eigen::VectorXd per_joint_mm;  // J; NaN for a joint that was never scored
  Eigen::MatrixXd each_mm;       // J x F; NaN for a joint that was not scored in a frame
};

struct JointErrors {
  std::vector<JointId> joints;
  int num_frames = 0;       // F
  int num_missing = 0;      // joint observations missing in either input
  AlignedError absolute;    // none
  AlignedError root;        // MPJPE: translation of the root per frame
  AlignedError scale;       // N-MPJPE: root translation and the best scale per frame
  AlignedError similarity;  // PA-MPJPE: the best rotation, translation and scale per frame
  AlignedError place;       // of the root alone, nothing aligned: J = 1
};

// Compares two joint trajectories. The root is the pelvis where both inputs have it, else the
// middle of the hips; frames without one are not scored by `root`, `scale` and `place`. `similarity` needs
// three joints that are not all in one place.
JointErrors CompareJoints(std::span<const JointId> joints, const Eigen::MatrixXd& estimate,
                          const Eigen::MatrixXd& truth);

// One line per alignment with the joint count, the alignment and the frames.
std::string FormatJointErrors(const JointErrors& errors);

// Rows of `wanted` joints out of a trajectory of `joints`; NaN for those that are not there.
Eigen::MatrixXd SelectJoints(const Eigen::MatrixXd& trajectories, std::span<const JointId> joints,
                             std::span<const JointId> wanted);

// Mean length of second differences.
struct SecondDifference {
  double mean_mm_per_frame2 = 0;  // NaN when no joint is seen in three frames in a row
  double mean_mm_per_s2 = 0;
  int num_observations = 0;
};

// Jitter: second difference of the joints as given.
SecondDifference Jitter(const Eigen::MatrixXd& trajectories, double fps);

// Acceleration error: second difference of (estimate - truth).
SecondDifference AccelerationError(const Eigen::MatrixXd& estimate, const Eigen::MatrixXd& truth,
                                   double fps);

// How constant bone lengths are over time.
struct BoneLengthDeviation {
  double mean_mm = 0;  // mean over bones of the standard deviation of the length
  double max_mm = 0;   // largest difference of a bone's length from its mean
  int num_bones = 0;   // bones whose two joints are listed and seen at least once
};
BoneLengthDeviation CompareBoneLengths(std::span<const JointId> joints,
                                       const Eigen::MatrixXd& trajectories,
                                       std::span<const JointPair> bones);

// Distance of projected joints (camera frame) from detected pixels.
struct ReprojectionError {
  double mean_px = 0;  // NaN when nothing was scored
  int num_observations = 0;
  int num_missing = 0;  // not detected, not estimated, or behind the camera
};
ReprojectionError CompareReprojection(const Camera& camera, std::span<const JointId> joints,
                                      const Eigen::MatrixXd& joints_in_camera,
                                      const Detections2d& detections);

// Intersection over union of two 8-bit masks (non-zero is inside); 1 when both are empty.
double MaskIou(const cv::Mat& a, const cv::Mat& b);

// How far outlines agree: the harmonic mean of precision (share of a's outline within the tolerance
// of b's) and recall (share of b's within that of a's). The outline is every pixel inside with one of
// its 4 neighbours outside; the picture's border is none. 1 when neither mask has an outline, 0 when
// one has. tolerance_px > 0; the default is that of DAVIS (Perazzi et al. 2016), 0.8 % of the
// picture's diagonal. Distances are Euclidean, to 1e-3 px.
double BoundaryF(const cv::Mat& a, const cv::Mat& b, double tolerance_px);
double BoundaryF(const cv::Mat& a, const cv::Mat& b);

// Masks of a clip: one IoU per frame, NaN for a frame that is not scored.
struct IouSummary {
  double mean = 0;          // NaN when no frame is scored
  double worst_decile = 0;  // mean over the worst tenth of the frames, at least one; NaN likewise
  int num_frames = 0;       // scored
};
IouSummary SummarizeIou(std::span<const double> iou_per_frame);

}  // namespace mpc
