#include "mpc/pose/windows.h"

#include <algorithm>

#include "mpc/core/rigid.h"

namespace mpc {

std::vector<Window> MakeWindows(int num_frames, int size, int overlap) {
  std::vector<Window> windows;
  for (int begin = 0;; begin += size - overlap) {
    if (begin + size >= num_frames) {
      windows.push_back({std::max(0, num_frames - size), num_frames});
      return windows;
    }
    windows.push_back({begin, begin + size});
  }
}

Eigen::VectorXd BlendPoses(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double w) {
  Eigen::VectorXd blended = (1 - w) * a + w * b;
  const Eigen::Matrix3d from = ExpSO3(a.segment<3>(3));
  const Eigen::Vector3d turn = LogSO3(from.transpose() * ExpSO3(b.segment<3>(3)));
  blended.segment<3>(3) = LogSO3(from * ExpSO3(w * turn));
  return blended;
}

Eigen::MatrixXd BlendWindows(const std::vector<Window>& windows,
                             const std::vector<Eigen::MatrixXd>& poses, int num_frames) {
  Eigen::MatrixXd joined(poses[0].rows(), num_frames);
  int done = 0;  // frames [0, done) hold the windows so far
  for (size_t i = 0; i < windows.size(); ++i) {
    const int shared = done - windows[i].begin;
    for (int f = windows[i].begin; f < windows[i].end; ++f) {
      const auto pose = poses[i].col(f - windows[i].begin);
      if (f < done) {
        const double w = (f - windows[i].begin + 1.0) / (shared + 1.0);
        joined.col(f) = BlendPoses(joined.col(f), pose, w);
      } else {
        joined.col(f) = pose;
      }
    }
    done = windows[i].end;
  }
  return joined;
}

}  // namespace mpc
