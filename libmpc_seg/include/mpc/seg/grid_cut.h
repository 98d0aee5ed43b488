// Purpose: the labels of a picture's unknown pixels that minimise GrabCut's energy with motion cue.
// Source: Rother et al., "GrabCut", 2004; motion cue: paper, Section 5.1.
// Units: pixels, natural logarithms of probabilities.
//
//   E(L) = sum_p -o_p [L_p = 1] + sum_pq [L_p != L_q] (s_p + s_q) / (2 |p - q|)
//          (gamma exp(-beta |I_p - I_q|^2) + gamma_m exp(-beta_m (|D_p|^2 + |D_q|^2) / 2))
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace mpc {

// All pictures have the same size.
struct GridCutProblem {
  cv::Mat bgr;       // CV_8UC3, I
  cv::Mat change;    // CV_16U, |D|^2 / 3, see SquaredChange; empty: no motion cue
  cv::Mat log_odds;  // CV_32F, o: of belonging to the actor; read at unknown pixels only
  cv::Mat trimap;    // CV_8U, TrimapLabel
  cv::Mat strength;  // CV_32F, 0 to 1, s: share of the links' strength; empty: 1
  double gamma = 50;
  double beta = 0;
  double gamma_motion = 0;
  double beta_motion = 0;
  bool eight_connected = false;
};

struct GridCutResult {
  cv::Mat labels;       // CV_8U, 1 inside
  int num_unknown = 0;  // pixels to decide
  int num_nodes = 0;    // of them, those that needed the maximum flow
};

// GrabCut's beta: 1 / (2 mean |I_p - I_q|^2) over all neighbours; 0 for a picture of one colour.
double ContrastBeta(const cv::Mat& bgr, bool eight_connected);

// |a - b|^2 / 3 per pixel, rounded, as CV_16U.
cv::Mat SquaredChange(const cv::Mat& a, const cv::Mat& b);

// The exact minimum, up to rounding of the terms to 1/1024. Pixels whose log-odds exceed all their
// links are decided first, which changes nothing but the time.
GridCutResult SolveGridCut(const GridCutProblem& problem);

// E of any labels that agree with the trimap, from the same rounded terms, in 1/1024.
int64_t GridCutEnergy(const GridCutProblem& problem, const cv::Mat& labels);

}  // namespace mpc
