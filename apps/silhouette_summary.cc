#include "silhouette_summary.h"

#include <fmt/format.h>

#include "mpc/eval/metrics.h"

namespace monoperfcap {
namespace {

mpc::IouSummary Summary(const std::vector<mpc::SilhouetteRecord>& records,
                        double mpc::SilhouetteRecord::*iou) {
  std::vector<double> values;
  for (const mpc::SilhouetteRecord& record : records) values.push_back(record.*iou);
  return mpc::SummarizeIou(values);
}

}  // namespace

std::string SilhouetteSummary(const std::vector<mpc::SilhouetteRecord>& records) {
  using mpc::SilhouetteRecord;
  if (records.empty()) return "";
  double confidence = 0;
  for (const SilhouetteRecord& record : records) confidence += record.confidence;
  std::string text = fmt::format("silhouettes: IoU with the model {:.4f}, confidence {:.2f}\n",
                                 Summary(records, &SilhouetteRecord::model_iou).mean,
                                 confidence / static_cast<double>(records.size()));
  const mpc::IouSummary truth = Summary(records, &SilhouetteRecord::true_iou);
  if (truth.num_frames == 0) return text;
  const mpc::IouSummary model = Summary(records, &SilhouetteRecord::model_true_iou);
  return text + fmt::format(
                    "IoU with the given masks over {} frames, mean and worst tenth: "
                    "silhouettes {:.4f} {:.4f}, model {:.4f} {:.4f}\n",
                    truth.num_frames, truth.mean, truth.worst_decile, model.mean,
                    model.worst_decile);
}

std::string RefinementSummary(const std::vector<mpc::RefinementRecord>& records) {
  using mpc::RefinementRecord;
  std::vector<mpc::SilhouetteRecord> silhouettes;
  std::vector<double> batch, surface;
  int num_poses = 0;
  int num_surfaces = 0;
  for (const RefinementRecord& record : records) {
    silhouettes.push_back(record.silhouette);
    batch.push_back(record.batch_true_iou);
    surface.push_back(record.surface_true_iou);
    num_poses += record.pose_state == mpc::RefinementState::kRefined ? 1 : 0;
    num_surfaces += record.surface_state == mpc::RefinementState::kRefined ? 1 : 0;
  }
  std::string text = SilhouetteSummary(silhouettes);
  if (records.empty()) return text;
  text += fmt::format("refined: {} poses and {} surfaces of {} frames\n", num_poses, num_surfaces,
                      records.size());
  const mpc::IouSummary before = mpc::SummarizeIou(batch);
  if (before.num_frames == 0) return text;
  const mpc::IouSummary after = mpc::SummarizeIou(surface);
  return text + fmt::format(
                    "of the result with the given masks: {:.4f} {:.4f}, before refinement "
                    "{:.4f} {:.4f}\n",
                    after.mean, after.worst_decile, before.mean, before.worst_decile);
}

}  // namespace monoperfcap
