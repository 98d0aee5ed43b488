// Purpose: cut a clip into overlapping windows and join their solutions again.
// Source: paper, Section 4: |B| = 50, 10 frames overlap, linear blending.
// Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace mpc {

// Frames [begin, end).
struct Window {
  int begin = 0;
  int end = 0;
  int size() const { return end - begin; }
};

// Windows of `size` frames, each starting size - overlap after the one before; the last one is moved
// back so that it is whole (its overlap is longer then). A clip shorter than `size` is one window.
std::vector<Window> MakeWindows(int num_frames, int size, int overlap);

// Joins the windows' poses (each N x its size) into N x F. Inside an overlap of m frames, frame i
// takes the weight (i + 1) / (m + 1) from the later window; root rotations blend on SO(3).
Eigen::MatrixXd BlendWindows(const std::vector<Window>& windows,
                             const std::vector<Eigen::MatrixXd>& poses, int num_frames);

// Linear blend of two poses, the root rotation on SO(3); w = 0 gives a, 1 gives b.
Eigen::VectorXd BlendPoses(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double w);

}  // namespace mpc
