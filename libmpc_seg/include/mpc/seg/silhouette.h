// Purpose: the actor's silhouette in a picture, from the masks of the posed model.
// Source: paper, Section 5.1 (GrabCut with a model-made trimap and motion cue); Rother et al.,
// "GrabCut", 2004. What differs from both, and why: docs/segmentation.md.
// Frames: pictures, pixel centres at integers. Units: pixels, natural logarithms of probabilities.
// Symbols: M mask of the actor's mesh, R mask of its skeleton.
//
// The minimum of
//   E(L) = sum_p U_p(L_p) + sum_pq [L_p != L_q] / |p - q|
//          (gamma exp(-beta |I_p - I_q|^2) + gamma_m exp(-beta_m (|D_p|^2 + |D_q|^2) / 2))
// over the unknown pixels of the trimap: U colour models, I colours, D change of the colour since
// the previous picture, or until the next where that is less, background motion taken out.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "mpc/seg/background_plate.h"
#include "mpc/seg/trimap.h"

namespace mpc {

struct SegmentationOptions {
  // Trimap, in parts of the actor's size (ActorSizePx).
  double erode = 0.09;        // radius of the erosion of M; ours
  double dilate = 0.13;       // radius of the dilation of M; ours
  bool clip_skeleton = true;  // take R only inside M; false: literally Eq. 9

  // Energy.
  double gamma = 50;           // contrast; GrabCut
  double gamma_motion = 20;    // motion cue, 0 turns it off; ours, at most gamma / 2
  double weight_still = 2;     // pixels as still as the background are background, 0: off; ours
  double weight_shape = 8;     // trust in M: log-odds at the border of the band, 0: none; ours
  double weight_measured = 1;  // on the log-odds of M's outline by its measured error, 0: off; ours
  double outline_discount = 0.9;  // on links where a measured M ends, 0: none, 1: all; ours
  double weight_plate = 2;        // on the log-odds of FrameInput::background, 0: off; ours
  double weight_person = 1;       // on the log-odds of FrameInput::person_probability; ours
  int num_components = 8;         // Gaussians per colour model, 1 to 16; ours, GrabCut: 5
  double colour_reach = 0.3;  // colours count most near their place, actor sizes, 0: alike; ours

  // Solution.
  int num_rounds = 1;  // of colour models and cut, >= 1; GrabCut: 5
  // Larger actors (ActorSizePx) are cut in half the size, a quarter and so on, and their outlines refined
  // at each size back; 0: the whole crop at once; ours.
  double max_cut_size_px = 200;
  bool eight_connected = false;  // neighbours; GrabCut: true
  bool band_colours = true;      // learn from eroded M and outside the band; false: from all of M
  bool look_ahead = true;        // use FrameInput::next where there is a previous, too; ours
  bool keep_earlier = true;      // use FrameInput::earlier; ours
  bool clean = true;             // remove islands and small holes
  bool estimate_background_motion = true;  // for the motion cue; false: static camera

  // GrabCut's full energy over the whole crop, 5 rounds, the literal trimap, and the motion cue.
  static SegmentationOptions Paper();

  // For a model that was already fitted to a silhouette: half the band, half the cost of outlines.
  static SegmentationOptions AfterRefinement();

  // Throws Error (kInvalidArgument) naming every fault.
  void Validate() const;
};

// Pictures are CV_8UC3 (BGR); CV_8UC1, CV_8UC4 and CV_16U of 1, 3 or 4 channels are converted.
struct FrameInput {
  cv::Mat picture;
  // The pictures before and after it; empty: none. With neither there is no motion cue.
  cv::Mat previous;
  cv::Mat next;
  cv::Mat model_mask;          // M, CV_8U, nonzero inside
  cv::Mat skeleton_mask;       // R, CV_8U; empty: none
  cv::Mat person_probability;  // CV_8U (0..255) or CV_32F (0..1), such as a network's; empty: none
  // Cut before, with another M: CV_8U, nonzero inside; empty: none. What it found beyond M's band, and thick
  // pieces of M that it did not find, may be clothes that move on their own, and stay undecided.
  cv::Mat earlier;
  BackgroundPlate background;  // what is behind the actor, of the picture's size; empty: unknown
  // The background's motions where they are known, else estimated when the options say so.
  std::optional<cv::Matx33d> previous_from_current;
  std::optional<cv::Matx33d> next_from_current;
  // ActorSizePx of the whole actor, when M shows only a part of it; 0: that of M.
  double actor_size_px = 0;
};

enum class SilhouetteState {
  kCut,           // the minimum of the energy
  kAmbiguous,     // actor and background have the same colours, or the cut collapsed: M itself
  kNoBackground,  // nothing of the background is seen near the actor: M itself
  kNoModel,       // M is empty: so is the mask
  kExternal,      // given from outside
};

// Short lower-case name, such as "cut".
const char* SilhouetteStateName(SilhouetteState state);

struct Silhouette {
  cv::Mat mask;  // CV_8U of the picture's size: 255 inside, 0 outside
  cv::Rect roi;  // contains every pixel that is not 0
  SilhouetteState state = SilhouetteState::kNoModel;
  // How well colours (and stillness, and the given probability) told actor and background apart
  // within the band: 0 not at all, 1 everywhere.
  double confidence = 0;
  double model_iou = 0;        // intersection over union of mask and M
  bool motion_cue = false;     // the motion cue was used
  bool camera_motion = false;  // a motion of the background was taken out
  // Those motions; none where the picture was not looked at.
  std::optional<cv::Matx33d> previous_from_current;
  std::optional<cv::Matx33d> next_from_current;
};

// Deterministic; safe to call from several threads. Any content of the pictures and masks gives a
// defined result (see SilhouetteState). Throws Error (kInvalidArgument, kMismatch, kUnsupported)
// for missing or unsupported matrices, sizes that differ, and options out of range.
Silhouette ExtractSilhouette(const FrameInput& frame, const SegmentationOptions& options = {});

// A mask made elsewhere in place of the stage: nonzero (above 127 where it is grey) is inside.
// CV_8U with 1, 3 or 4 channels, of size `picture_size`; throws Error otherwise.
Silhouette SilhouetteFromMask(const cv::Mat& mask, const cv::Size& picture_size);

}  // namespace mpc
