#include "model_fit.h"

#include <fmt/format.h>

#include <limits>

#include "mpc/core/thread_pool.h"
#include "mpc/eval/metrics.h"
#include "mpc/render/model_mask.h"
#include "silhouette_maker.h"

namespace mpc::internal {
namespace {

// Where poses are right this is 0.7 to 0.85: clothes and hair are no part of the network's model of
// a person as they are of the mesh.
constexpr double kMinIou = 0.5;

}  // namespace

std::vector<double> ModelFit(const Character& character, const Camera& camera,
                             const Eigen::MatrixXd& poses, std::span<const PersonMask> masks,
                             int num_threads) {
  const SurfaceTopology topology = SurfaceTopology::FromMesh(character.mesh);
  std::vector<double> iou(static_cast<size_t>(poses.cols()),
                          std::numeric_limits<double>::quiet_NaN());
  ParallelFor(static_cast<int>(masks.size()), num_threads, [&](int i) {
    const PersonMask& mask = masks[static_cast<size_t>(i)];
    const cv::Mat model = PosedModelMask(character, camera, topology, poses.col(mask.frame));
    iou[static_cast<size_t>(mask.frame)] = MaskIou(model, PictureMask(mask, model.size()) > 127);
  });
  return iou;
}

void AddModelFitWarning(std::span<const double> iou, std::vector<std::string>* warnings) {
  const IouSummary summary = SummarizeIou(iou);
  if (summary.num_frames == 0 || summary.mean >= kMinIou) return;
  warnings->push_back(
      fmt::format("the posed actor covers the person badly (intersection over union with the "
                  "networks' masks {:.2f}, expected {} or more): look at overlay.mp4",
                  summary.mean, kMinIou));
}

}  // namespace mpc::internal
