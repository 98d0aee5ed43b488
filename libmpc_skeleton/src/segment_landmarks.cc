#include "segment_landmarks.h"

#include <cmath>
#include <limits>

namespace mpc {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;

// The vertex with the highest score among those accepted, or -1.
template <typename Accept, typename Score>
int Best(const Matrix3Xd& vertices, const Accept& accept, const Score& score) {
  int best = -1;
  double best_score = -std::numeric_limits<double>::infinity();
  for (int v = 0; v < vertices.cols(); ++v) {
    const Vector3d x = vertices.col(v);
    if (accept(x) && score(x) > best_score) {
      best = v;
      best_score = score(x);
    }
  }
  return best;
}

double Forward(const Vector3d& x) { return x.z(); }

// Fractions of the head's box (height from chin to top, width, depth), after the classical canon:
// eyes at half the height, ears between the eyes and the base of the nose.
std::optional<FaceLandmarks> FindFace(const Matrix3Xd& vertices) {
  const double chin = vertices.row(1).minCoeff();
  const double height = vertices.row(1).maxCoeff() - chin;
  const auto in_band = [&](const Vector3d& x, double low, double high) {
    return x.y() >= chin + low * height && x.y() <= chin + high * height;
  };
  const auto middle = [&](const Vector3d& x) { return in_band(x, 0.3, 0.65); };
  const int left = Best(vertices, middle, [](const Vector3d& x) { return x.x(); });
  const int right = Best(vertices, middle, [](const Vector3d& x) { return -x.x(); });
  const int back = Best(vertices, middle, [](const Vector3d& x) { return -x.z(); });
  if (left < 0) return std::nullopt;
  const double width = vertices(0, left) - vertices(0, right);
  const int nose = Best(
      vertices, [&](const Vector3d& x) { return middle(x) && std::abs(x.x()) < 0.15 * width; },
      Forward);
  if (nose < 0 || width <= 0) return std::nullopt;
  const double depth = vertices(2, nose) - vertices(2, back);
  if (vertices(2, nose) <= 0 || depth < 0.3 * width) return std::nullopt;

  FaceLandmarks face;
  face.nose = {0, vertices(1, nose), vertices(2, nose)};
  const double eye_y = chin + 0.5 * height;
  const auto eye = [&](double x) {
    const int surface = Best(
        vertices,
        [&](const Vector3d& v) {
          return std::abs(v.x() - x) < 0.1 * width && std::abs(v.y() - eye_y) < 0.08 * height;
        },
        Forward);
    const double z = surface >= 0 ? vertices(2, surface) : vertices(2, nose) - 0.15 * depth;
    return Vector3d(x, eye_y, z);
  };
  face.left_eye = eye(0.21 * width);
  face.right_eye = eye(-0.21 * width);
  const double ear_y = chin + 0.45 * height;
  const double ear_z = vertices(2, back) + 0.45 * depth;
  face.left_ear = {0.48 * width, ear_y, ear_z};
  face.right_ear = {-0.48 * width, ear_y, ear_z};
  return face;
}

}  // namespace

HeadLandmarks FindHeadLandmarks(const Matrix3Xd& vertices) {
  HeadLandmarks landmarks;
  if (vertices.cols() == 0) return landmarks;
  const double top = vertices.row(1).maxCoeff();
  if (top <= 0) return landmarks;
  // Depth of the crown: mean of what lies in the uppermost tenth.
  double sum_z = 0;
  int count = 0;
  for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
    if (vertices(1, v) < 0.9 * top) continue;
    sum_z += vertices(2, v);
    ++count;
  }
  landmarks.top = Vector3d(0, top, sum_z / count);
  landmarks.face = FindFace(vertices);
  return landmarks;
}

std::optional<FootLandmarks> FindFootLandmarks(const Matrix3Xd& vertices, double inner_x) {
  if (vertices.cols() == 0) return std::nullopt;
  const Vector3d low = vertices.rowwise().minCoeff();
  const Vector3d high = vertices.rowwise().maxCoeff();
  const Vector3d extent = high - low;
  if (high.z() <= 0 || extent.z() <= 0 || extent.z() < extent.x()) return std::nullopt;

  const auto forefoot = [&](const Vector3d& x) { return x.z() > low.z() + 0.6 * extent.z(); };
  const auto outward = [&](const Vector3d& x) { return -inner_x * x.x(); };
  const int outer = Best(vertices, forefoot, outward);
  const int inner = Best(vertices, forefoot, [&](const Vector3d& x) { return -outward(x); });
  const double inner_edge = outward(vertices.col(inner));
  const double width = outward(vertices.col(outer)) - inner_edge;
  const auto across = [&](const Vector3d& x) { return outward(x) - inner_edge; };  // 0 to width
  const int big_toe = Best(
      vertices, [&](const Vector3d& x) { return forefoot(x) && across(x) <= 0.5 * width; },
      Forward);
  const int small_toe = Best(
      vertices, [&](const Vector3d& x) { return forefoot(x) && across(x) >= 0.75 * width; },
      Forward);
  const int heel = Best(
      vertices, [&](const Vector3d& x) { return x.y() <= low.y() + 0.35 * extent.y(); },
      [](const Vector3d& x) { return -x.z(); });
  return FootLandmarks{vertices.col(big_toe), vertices.col(small_toe), vertices.col(heel)};
}

}  // namespace mpc
