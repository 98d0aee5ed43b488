#include <limits>

#include "mpc/deform/surface_solver.h"

namespace mpc {
namespace {

template <typename Energy>
double CostOf(const Energy& energy, const WarpField& at) {
  double cost = 0;
  Eigen::Vector3d r = Eigen::Vector3d::Zero();
  for (int block = 0; block < energy.num_blocks(); ++block) {
    if (!energy.Evaluate(at, block, r.data(), nullptr)) {
      return std::numeric_limits<double>::infinity();
    }
    cost += r.head(energy.rows()).squaredNorm();
  }
  return cost;
}

}  // namespace

SurfaceProblem::SurfaceProblem(const Camera& camera, const DeformationGraph& graph,
                               const Eigen::Matrix3Xf& posed,
                               const Correspondences& correspondences,
                               const SurfaceWeights& weights, const WarpField& start)
    : contour(camera, graph, posed, correspondences),
      arap(graph, graph.NodePositions(posed), weights.arap),
      drift(graph.NodePositions(posed), start.translations, weights.depth_drift,
            weights.side_drift),
      nodes(graph.NodePositions(posed)),
      num_nodes(graph.num_nodes()) {}

double SurfaceProblem::Cost(const WarpField& at) const {
  return CostOf(contour, at) + CostOf(arap, at) + CostOf(drift, at);
}

}  // namespace mpc
