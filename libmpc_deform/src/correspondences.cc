#include "mpc/deform/correspondences.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "mpc/core/error.h"

namespace mpc {
namespace {

constexpr double kMedianToSigma = 1.4826;  // of the sizes of a normal distribution's values
constexpr double kPictureBorder_px = 2;
constexpr double kAlwaysNear_px = 2;
// Half the width of the window in which vertices share their length of outline, m.
constexpr double kLengthWindow_m = 0.02;
// Of AddUnexplained.
constexpr double kExplained_m = 0.015;
constexpr double kFarthest_m = 0.3;
constexpr double kRoughlyCos = 0.2;

// Vertices of the outline by their x, and who lies within reach of one and faces the same way.
class OutlineOrder {
 public:
  explicit OutlineOrder(const ModelBoundary& outline)
      : outline_(outline), by_x_(outline.vertices.size()) {
    std::iota(by_x_.begin(), by_x_.end(), 0);
    std::sort(by_x_.begin(), by_x_.end(), [&](int a, int b) {
      return std::pair(outline.pixels(0, a), a) < std::pair(outline.pixels(0, b), b);
    });
  }

  int operator[](size_t i) const { return by_x_[i]; }

  // Calls visit(w) for every such vertex w, the i-th itself among them.
  template <typename Visit>
  void ForNeighbours(size_t i, double reach_px, const Visit& visit) const {
    const int v = by_x_[i];
    const auto look = [&](size_t k) {
      const int w = by_x_[k];
      const Eigen::Vector2d apart = outline_.pixels.col(w) - outline_.pixels.col(v);
      if (std::abs(apart.x()) > reach_px) return false;
      if (apart.squaredNorm() <= reach_px * reach_px &&
          outline_.normals.col(v).dot(outline_.normals.col(w)) > 0) {
        visit(w);
      }
      return true;
    };
    for (size_t k = i; k < by_x_.size() && look(k); ++k) {
    }
    for (size_t k = i; k > 0 && look(k - 1); --k) {
    }
  }

 private:
  const ModelBoundary& outline_;
  std::vector<int> by_x_;
};

double PxPerMetre(const Camera& camera, const Eigen::Matrix3Xf& positions, int vertex) {
  return std::max(camera.fx, camera.fy) / positions(2, vertex);
}

Eigen::VectorXd PxPerMetre(const Camera& camera, const Eigen::Matrix3Xf& positions,
                           const std::vector<int>& vertices) {
  Eigen::VectorXd px_per_m(std::ssize(vertices));
  for (size_t i = 0; i < vertices.size(); ++i) {
    px_per_m[static_cast<Eigen::Index>(i)] = PxPerMetre(camera, positions, vertices[i]);
  }
  return px_per_m;
}

// Of vertices from their targets, along the targets' normals, m.
Eigen::VectorXd DistancesAlong(const Eigen::Matrix2Xd& normals, const Eigen::Matrix2Xd& way,
                               const Eigen::VectorXd& px_per_m) {
  return way.cwiseProduct(normals).colwise().sum().transpose().cwiseQuotient(px_per_m);
}

// Leaves out vertices within reach of one that stays.
void Thin(const Camera& camera, const Eigen::Matrix3Xf& positions, double min_spacing_m,
          ModelBoundary* outline) {
  const OutlineOrder order(*outline);
  std::vector<uint8_t> stays(outline->vertices.size(), 0);
  for (size_t i = 0; i < stays.size(); ++i) {
    const int v = order[i];
    const double reach =
        min_spacing_m * PxPerMetre(camera, positions, outline->vertices[static_cast<size_t>(v)]);
    bool alone = true;
    order.ForNeighbours(i, reach, [&](int w) { alone &= stays[static_cast<size_t>(w)] == 0; });
    stays[static_cast<size_t>(v)] = alone;
  }
  std::vector<int> kept, vertices;
  for (int i = 0; i < static_cast<int>(stays.size()); ++i) {
    if (stays[static_cast<size_t>(i)] == 0) continue;
    kept.push_back(i);
    vertices.push_back(outline->vertices[static_cast<size_t>(i)]);
  }
  *outline = {vertices, outline->pixels(Eigen::all, kept), outline->normals(Eigen::all, kept)};
}

// One over the number of vertices within the window, then scaled to mean 1.
Eigen::VectorXd LengthWeights(const ModelBoundary& outline, const Eigen::VectorXd& px_per_m) {
  const OutlineOrder order(outline);
  Eigen::VectorXd weights(outline.pixels.cols());
  for (size_t i = 0; i < outline.vertices.size(); ++i) {
    int count = 0;
    order.ForNeighbours(i, kLengthWindow_m * px_per_m[order[i]], [&](int) { ++count; });
    weights[order[i]] = 1.0 / count;
  }
  return weights / weights.mean();
}

// Per vertex of the boundary: the point of the silhouette, or -1.
std::vector<int> FindTargets(const ModelBoundary& boundary, const Eigen::VectorXd& px_per_m,
                             const BodyParts& parts, const ContourIndex& silhouette,
                             const CorrespondenceOptions& options) {
  const Contour2d& contour = silhouette.contour();
  const double min_cos = std::cos(options.max_angle_rad);
  const ContourIndex model({boundary.pixels, boundary.normals});
  std::vector<int> targets(boundary.vertices.size(), -1);
  for (size_t i = 0; i < targets.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    const double reach = options.max_distance_m * px_per_m[column];
    const int target = silhouette.Nearest(boundary.pixels.col(column), boundary.normals.col(column),
                                          reach, min_cos);
    if (target < 0) continue;
    const Eigen::Vector2d way = boundary.pixels.col(column) - contour.points.col(target);
    if (way.norm() > kAlwaysNear_px && std::abs(way.dot(contour.normals.col(target))) <
                                           std::cos(options.max_slant_rad) * way.norm()) {
      continue;
    }
    if (options.match_parts) {
      // The part that a point of the silhouette shows is that of the model's nearest outline.
      const int looks_like = model.Nearest(contour.points.col(target), contour.normals.col(target),
                                           reach * (1 + 1e-9), min_cos);
      if (looks_like < 0 || !parts.Compatible(boundary.vertices[i],
                                              boundary.vertices[static_cast<size_t>(looks_like)])) {
        continue;
      }
    }
    targets[i] = target;
  }
  return targets;
}

// Drops the targets of parts, and of the model, that have too few.
void DropUnsupported(const ModelBoundary& boundary, const Eigen::VectorXd& weights,
                     const BodyParts& parts, const CorrespondenceOptions& options,
                     std::vector<int>* targets) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(parts.num_parts()), matched = all;
  const auto part = [&](size_t i) { return parts.part(boundary.vertices[i]); };
  for (size_t i = 0; i < targets->size(); ++i) {
    const double weight = weights[static_cast<Eigen::Index>(i)];
    all[part(i)] += weight;
    if ((*targets)[i] >= 0) matched[part(i)] += weight;
  }
  const bool whole = matched.sum() >= options.min_support * all.sum();
  for (size_t i = 0; i < targets->size(); ++i) {
    const bool supported = matched[part(i)] >= options.min_part_support * all[part(i)];
    if (!whole || !supported) (*targets)[i] = -1;
  }
}

}  // namespace

CorrespondenceOptions CorrespondenceOptions::Paper() {
  CorrespondenceOptions options;
  options.max_distance_m = 10;
  options.match_parts = false;
  options.min_part_support = 0;
  options.min_support = 0;
  options.weigh_by_length = false;
  return options;
}

void CorrespondenceOptions::Validate() const {
  std::string faults;
  const auto check = [&](bool good, const char* name, double value, const char* expected) {
    if (good) return;
    faults +=
        fmt::format("{}{} is {}, expected {}", faults.empty() ? "" : "; ", name, value, expected);
  };
  check(max_distance_m > 0 && std::isfinite(max_distance_m), "max_distance_m", max_distance_m,
        "a positive number");
  check(max_angle_rad > 0 && max_angle_rad <= std::numbers::pi, "max_angle_rad", max_angle_rad,
        "0 to pi");
  check(max_slant_rad > 0 && max_slant_rad <= std::numbers::pi / 2, "max_slant_rad", max_slant_rad,
        "0 to pi / 2");
  check(min_part_support >= 0 && min_part_support <= 1, "min_part_support", min_part_support,
        "0 to 1");
  check(min_support >= 0 && min_support <= 1, "min_support", min_support, "0 to 1");
  check(min_spacing_m >= 0 && std::isfinite(min_spacing_m), "min_spacing_m", min_spacing_m,
        "at least 0");
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "correspondences: " + faults);
}

ContourIndex IndexSilhouette(const Contour2d& contour, const Camera& camera) {
  if (contour.points.cols() != contour.normals.cols()) return ContourIndex(contour);  // throws
  std::vector<Eigen::Index> inside;
  for (Eigen::Index i = 0; i < contour.points.cols(); ++i) {
    const double x = contour.points(0, i), y = contour.points(1, i);
    const bool at_border = x < kPictureBorder_px || x > camera.width - 1 - kPictureBorder_px ||
                           y < kPictureBorder_px || y > camera.height - 1 - kPictureBorder_px;
    if (!at_border) inside.push_back(i);
  }
  return ContourIndex({contour.points(Eigen::all, inside), contour.normals(Eigen::all, inside)});
}

ModelBoundary FindOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                          const SurfaceTopology& topology, const CorrespondenceOptions& options,
                          CorrespondenceScratch* scratch) {
  ModelBoundary outline =
      DrawModelBoundary(camera, positions_in_camera, topology, options.drop_hidden, scratch);
  if (options.min_spacing_m > 0) {
    Thin(camera, positions_in_camera, options.min_spacing_m, &outline);
  }
  return outline;
}

Correspondences MatchOutline(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                             const ModelBoundary& outline, const BodyParts& parts,
                             const ContourIndex& silhouette, const CorrespondenceOptions& options) {
  Correspondences found;
  found.num_boundary = static_cast<int>(outline.vertices.size());
  if (found.num_boundary == 0) return found;
  const Eigen::VectorXd px_per_m = PxPerMetre(camera, positions_in_camera, outline.vertices);
  const Eigen::VectorXd weights = options.weigh_by_length
                                      ? LengthWeights(outline, px_per_m)
                                      : Eigen::VectorXd::Ones(found.num_boundary);
  std::vector<int> targets = FindTargets(outline, px_per_m, parts, silhouette, options);
  DropUnsupported(outline, weights, parts, options, &targets);

  std::vector<int> kept, points;
  for (int i = 0; i < found.num_boundary; ++i) {
    if (targets[static_cast<size_t>(i)] < 0) continue;
    kept.push_back(i);
    points.push_back(targets[static_cast<size_t>(i)]);
    found.vertices.push_back(outline.vertices[static_cast<size_t>(i)]);
  }
  found.targets = silhouette.contour().points(Eigen::all, points);
  found.normals = silhouette.contour().normals(Eigen::all, points);
  found.weights = weights(kept);
  found.distances = DistancesAlong(found.normals, outline.pixels(Eigen::all, kept) - found.targets,
                                   px_per_m(kept));
  return found;
}

void AddUnexplained(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                    const ModelBoundary& outline, const BodyParts& parts,
                    const ContourIndex& silhouette, const CorrespondenceOptions& options,
                    Correspondences* found) {
  if (outline.vertices.empty()) return;
  std::vector<uint8_t> has_targets(static_cast<size_t>(parts.num_parts()), 0);
  for (const int v : found->vertices) has_targets[static_cast<size_t>(parts.part(v))] = 1;
  const Eigen::VectorXd px_per_m = PxPerMetre(camera, positions_in_camera, outline.vertices);
  const double typical = px_per_m.mean(), same_cos = std::cos(options.max_angle_rad);
  const Contour2d& contour = silhouette.contour();
  const ContourIndex model({outline.pixels, outline.normals});
  std::vector<int> columns, points;
  for (int i = 0; i < contour.points.cols(); ++i) {
    const Eigen::Vector2d point = contour.points.col(i), normal = contour.normals.col(i);
    if (model.Nearest(point, normal, kExplained_m * typical, same_cos) >= 0) continue;
    const int nearest = model.Nearest(point, normal, kFarthest_m * typical, kRoughlyCos);
    if (nearest < 0) continue;
    const int vertex = outline.vertices[static_cast<size_t>(nearest)];
    if (has_targets[static_cast<size_t>(parts.part(vertex))] == 0) continue;
    columns.push_back(nearest);
    points.push_back(i);
    found->vertices.push_back(vertex);
  }
  const auto append = [](const auto& more, auto* all) {
    const auto before = all->cols();
    all->conservativeResize(Eigen::NoChange, before + more.cols());
    all->rightCols(more.cols()) = more;
  };
  const Eigen::Matrix2Xd targets = contour.points(Eigen::all, points);
  const Eigen::Matrix2Xd normals = contour.normals(Eigen::all, points);
  const Eigen::VectorXd distances =
      DistancesAlong(normals, outline.pixels(Eigen::all, columns) - targets, px_per_m(columns));
  append(targets, &found->targets);
  append(normals, &found->normals);
  found->distances.conservativeResize(found->size());
  found->distances.tail(distances.size()) = distances;
  found->weights.conservativeResize(found->size());
  found->weights.tail(distances.size())
      .setConstant(static_cast<double>(found->num_boundary) /
                   static_cast<double>(contour.points.cols()));
}

double RobustScale(const Correspondences& correspondences, double deviations) {
  if (correspondences.size() == 0) return 0;
  std::vector<double> sizes;
  for (const double distance : correspondences.distances) sizes.push_back(std::abs(distance));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return deviations * kMedianToSigma * *middle;
}

Correspondences FindCorrespondences(const Camera& camera,
                                    const Eigen::Matrix3Xf& positions_in_camera,
                                    const SurfaceTopology& topology, const BodyParts& parts,
                                    const ContourIndex& silhouette,
                                    const CorrespondenceOptions& options,
                                    CorrespondenceScratch* scratch) {
  options.Validate();
  return MatchOutline(camera, positions_in_camera,
                      FindOutline(camera, positions_in_camera, topology, options, scratch), parts,
                      silhouette, options);
}

}  // namespace mpc
