#include "evaluation_table.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <span>

namespace monoperfcap {
namespace {

using Json = nlohmann::ordered_json;

int CountFinite(const Eigen::VectorXd& values) {
  return static_cast<int>(values.array().isFinite().count());
}

std::string JointNames(const Evaluation& evaluation) {
  std::string names;
  for (const mpc::JointId joint : evaluation.joints) {
    names += fmt::format("{}{}", names.empty() ? "" : " ", mpc::JointName(joint));
  }
  return names;
}

class ScoreList {
 public:
  explicit ScoreList(const Evaluation& evaluation)
      : evaluation_(evaluation), joints_(fmt::format("{} joints", evaluation.joints.size())) {}

  void AddJoints() {
    const mpc::JointErrors& errors = evaluation_.errors;
    AddAligned("mpjpe", "MPJPE", errors.root, joints_);
    AddAligned("n_mpjpe", "N-MPJPE", errors.scale, joints_);
    AddAligned("pa_mpjpe", "PA-MPJPE", errors.similarity, joints_);
    AddAligned("absolute", "absolute", errors.absolute, joints_);
    AddAligned("root", "root", errors.place, "pelvis, or middle of the hips");
    if (evaluation_.reprojection) {
      Add({"reprojection", "mean_px", "reprojection", evaluation_.reprojection->mean_px, "px",
           joints_ + " against the true ones, projected", "none", evaluation_.num_frames()});
    }
    AddDifference("jitter", "jitter", evaluation_.jitter, joints_);
    AddDifference("truth_jitter", "jitter of truth", evaluation_.truth_jitter, joints_);
    AddDifference("acceleration_error", "acceleration", evaluation_.acceleration,
                  joints_ + ", estimate - truth");
    Add({"limb_length_deviation", "max_mm", "limb length", evaluation_.bones.max_mm, "mm",
         fmt::format("{} limbs, largest difference from their mean", evaluation_.bones.num_bones),
         "none", evaluation_.num_frames()});
    if (evaluation_.skate) {
      Add({"foot_skate", "mean_mm", "foot skate", evaluation_.skate->mean_mm, "mm/frame",
           fmt::format("ankles and toes, {} contacts of the truth",
                       evaluation_.skate->num_contacts),
           "none", evaluation_.skate->num_frames});
    }
  }

  void AddSurface(const SurfaceScores& surface) {
    const Eigen::Vector3d t = 1000 * surface.translation;
    const std::string alignment =
        fmt::format("one translation of the clip, ({:.1f} {:.1f} {:.1f}) mm", t.x(), t.y(), t.z());
    const auto add = [&](const char* key, const char* label, const Eigen::VectorXd& mm,
                         const char* scored) {
      if (mm.size() == 0) return;
      Add({key, "mean_mm", label, mm.mean(), "mm", scored, alignment, CountFinite(mm)});
    };
    add("vertex_error", "vertex error", surface.vertex_mm, "all vertices");
    add("surface_error", "surface error", surface.surface_mm, "surface to surface, both ways");
  }

  void AddMasks(const std::string& key, const std::string& label, const MaskScores& masks) {
    const auto add = [&](const char* suffix, const char* field, const std::string& name,
                         double value, int num_frames) {
      Add({key + suffix, field, name, value, "", label + " against true masks", "none",
           num_frames});
    };
    const mpc::IouSummary iou = mpc::SummarizeIou(Span(masks.iou));
    const mpc::IouSummary f = mpc::SummarizeIou(Span(masks.boundary_f));
    add("_iou", "mean", "IoU", iou.mean, iou.num_frames);
    add("_iou_worst_tenth", "mean", "IoU, worst", iou.worst_decile, (iou.num_frames + 9) / 10);
    add("_boundary_f", "mean", "boundary F", f.mean, f.num_frames);
  }

  std::vector<Score> Take() { return std::move(scores_); }

 private:
  static std::span<const double> Span(const Eigen::VectorXd& values) {
    return {values.data(), static_cast<size_t>(values.size())};
  }
  void Add(Score score) { scores_.push_back(std::move(score)); }
  void AddAligned(const char* key, const char* label, const mpc::AlignedError& error,
                  const std::string& scored) {
    Add({key, "mean_mm", label, error.mean_mm, "mm", scored, error.alignment, error.num_frames});
  }
  void AddDifference(const char* key, const char* label, const mpc::SecondDifference& difference,
                     const std::string& scored) {
    Add({key, "mean_mm_per_frame2", label, difference.mean_mm_per_frame2, "mm/frame^2",
         std::isfinite(difference.mean_mm_per_s2)
             ? fmt::format("{}, {:.3g} m/s^2", scored, difference.mean_mm_per_s2 / 1000)
             : scored,
         "none", evaluation_.num_frames()});
  }

  const Evaluation& evaluation_;
  std::string joints_;
  std::vector<Score> scores_;
};

Json Numbers(const Eigen::VectorXd& values) {
  Json numbers = Json::array();
  for (const double value : values) {
    numbers.push_back(NumberJson(std::round(value * 1e4) / 1e4));
  }
  return numbers;
}

}  // namespace

std::vector<Score> Scores(const Evaluation& evaluation) {
  ScoreList list(evaluation);
  list.AddJoints();
  if (evaluation.surface) list.AddSurface(*evaluation.surface);
  if (evaluation.model) list.AddMasks("model", "mesh", *evaluation.model);
  if (evaluation.silhouettes) list.AddMasks("silhouette", "silhouettes", *evaluation.silhouettes);
  return list.Take();
}

double ScoreValue(const std::vector<Score>& scores, const std::string& key) {
  for (const Score& score : scores) {
    if (score.key == key) return score.value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

std::string ValueText(const Score& score) {
  if (!std::isfinite(score.value)) return "-";
  return fmt::format("{:.{}f}", score.value, score.unit.empty() ? 4 : 2);
}

std::string EvaluationText(const Evaluation& evaluation) {
  std::string text;
  for (const Score& score : Scores(evaluation)) {
    text += fmt::format("{:<16} {:>9} {:<10} {}; aligned: {}; {} of {} frames\n", score.label,
                        ValueText(score), score.unit, score.scored, score.alignment,
                        score.num_frames, evaluation.num_frames());
  }
  for (const std::string& part : evaluation.skipped) text += "skipped: " + part + "\n";
  return text + "joints: " + JointNames(evaluation) + "\n";
}

Json EvaluationJson(const Evaluation& evaluation) {
  Json json = {{"format", "mpc-evaluation"},
               {"version", 1},
               {"estimate", evaluation.estimate},
               {"truth", evaluation.truth},
               {"fps", evaluation.fps},
               {"frames", evaluation.num_frames()},
               {"joints", JointNames(evaluation)},
               {"missing_observations", evaluation.errors.num_missing},
               {"skipped", evaluation.skipped}};
  for (const Score& score : Scores(evaluation)) {
    json[score.key] = {{score.field, NumberJson(score.value)},
                       {"scored", score.scored},
                       {"alignment", score.alignment},
                       {"frames", score.num_frames}};
  }
  const mpc::JointErrors& errors = evaluation.errors;
  Json per_joint = Json::object();
  for (size_t i = 0; i < errors.joints.size(); ++i) {
    per_joint[std::string(mpc::JointName(errors.joints[i]))] =
        NumberJson(errors.root.per_joint_mm[static_cast<Eigen::Index>(i)]);
  }
  json["mpjpe_per_joint_mm"] = per_joint;
  Json& per_frame = json["per_frame"];
  per_frame = {{"mpjpe_mm", Numbers(errors.root.per_frame_mm)},
               {"pa_mpjpe_mm", Numbers(errors.similarity.per_frame_mm)},
               {"root_mm", Numbers(errors.place.per_frame_mm)}};
  if (evaluation.surface) {
    per_frame["vertex_error_mm"] = Numbers(evaluation.surface->vertex_mm);
    per_frame["surface_error_mm"] = Numbers(evaluation.surface->surface_mm);
  }
  if (evaluation.model) per_frame["model_iou"] = Numbers(evaluation.model->iou);
  if (evaluation.silhouettes) per_frame["silhouette_iou"] = Numbers(evaluation.silhouettes->iou);
  return json;
}

Json NumberJson(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace monoperfcap
