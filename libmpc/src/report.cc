#include "report.h"

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "mpc/eval/metrics.h"
#include "mpc/io/atomic_file.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

double Rounded(double value, double unit) { return std::round(value / unit) * unit; }

template <typename Matrix>
Json MatrixRows(const Matrix& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json Vector(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

template <typename To, typename From>
Json Transform(const Rigid<To, From>& transform) {
  return {{"R", MatrixRows(transform.rotation)}, {"t", Vector(transform.translation)}};
}

Json CameraJson(const Camera& camera) {
  Json json = {{"name", camera.name}, {"width", camera.width},    {"height", camera.height},
               {"fx", camera.fx},     {"fy", camera.fy},          {"cx", camera.cx},
               {"cy", camera.cy},     {"dist", camera.distortion}};
  json["has_extrinsics"] = camera.has_extrinsics;
  return json;
}

Json WorldJson(const WorldPlacement& world) {
  return {{"world_from_camera", Transform(world.world_from_camera)},
          {"scene_from_world", Transform(world.scene_from_world)},
          {"scene_from_camera", Transform(world.scene_from_camera())},
          {"up_in_camera", Vector(world.up_in_camera)},
          {"num_upright_frames", world.num_upright_frames},
          {"moving_camera", !world.moving_world_from_camera.empty()}};
}

Json PoseOptionsJson(const PoseOptions& options) {
  return {{"window_frames", options.window_frames},
          {"overlap_frames", options.overlap_frames},
          {"basis_size", options.basis_size},
          {"cutoff_hz", options.cutoff_hz},
          {"weight_smooth", options.weight_smooth},
          {"soft_band", options.soft_band},
          {"adaptive_band", options.adaptive_band},
          {"lambda_translation", options.lambda_translation},
          {"lambda_rotation", options.lambda_rotation},
          {"lambda_angles", options.lambda_angles},
          {"repair_detections", options.repair_detections},
          {"anisotropic_3d", options.anisotropic_3d},
          {"weight_3d", options.weight_3d},
          {"error_2d_mm", options.error_2d_mm},
          {"error_3d_mm", options.error_3d_mm},
          {"depth_error_ratio", options.depth_error_ratio},
          {"pixels_in_mm", options.pixels_in_mm},
          {"confidence_weights", options.confidence_weights},
          {"robust_2d", options.robust_2d},
          {"robust_3d", options.robust_3d},
          {"pck_threshold", options.pck_threshold},
          {"test_depth_flips", options.test_depth_flips},
          {"hold_standing_feet", options.hold_standing_feet},
          {"lasting_discount", options.lasting_discount},
          {"weight_rest", options.weight_rest},
          {"fit_proportions", options.fit_proportions}};
}

Json ProportionsJson(const CaptureReport& report) {
  Json parts = Json::object();
  for (int p = 0; p < kNumBodyParts; ++p) {
    parts[BodyPartName(static_cast<BodyPart>(p))] = {
        {"scale", report.track.proportions.part[static_cast<size_t>(p)]},
        {"uncertainty", report.track.uncertainty.part[static_cast<size_t>(p)]}};
  }
  return {{"height_scale", report.height_scale},
          {"overall", report.track.proportions.overall},
          {"parts", std::move(parts)}};
}

Json MappingJson(const CaptureReport& report) {
  Json parts = Json::object();
  for (int p = 0; p < kNumRigParts; ++p) {
    const int bone = report.mapping.bone[static_cast<size_t>(p)];
    Json name = nullptr;
    if (bone >= 0) name = report.rig_bones[static_cast<size_t>(bone)];
    parts[RigPartName(static_cast<RigPart>(p))] = std::move(name);
  }
  return {{"convention", report.mapping.convention},
          {"parts", std::move(parts)},
          {"notes", report.mapping.notes}};
}

// One array per quantity, in the order of "joints": short, and easy to load as a table.
Json FrameJson(const FrameReport& frame, double time_s) {
  Json states = Json::array();
  Json residuals = Json::array();
  Json confidences = Json::array();
  for (const JointReport& joint : frame.joints) {
    states.push_back(TrackStateName(joint.state));
    residuals.push_back(Rounded(joint.residual_px, 1e-2));
    confidences.push_back(Rounded(joint.confidence, 1e-3));
  }
  return {{"time_s", Rounded(time_s, 1e-6)},
          {"state", TrackStateName(frame.state)},
          {"residual_px", Rounded(frame.residual_px, 1e-2)},
          {"confidence", Rounded(frame.confidence, 1e-3)},
          {"used_3d", frame.used_3d},
          {"swapped_sides", frame.swapped_sides},
          {"joints",
           {{"state", std::move(states)},
            {"residual_px", std::move(residuals)},
            {"confidence", std::move(confidences)}}}};
}

Json SilhouetteJson(const SilhouetteRecord& record) {
  Json json = {{"state", SilhouetteStateName(record.state)},
               {"confidence", Rounded(record.confidence, 1e-3)},
               {"model_iou", Rounded(record.model_iou, 1e-4)},
               {"camera_motion", record.camera_motion}};
  if (std::isfinite(record.true_iou)) {
    json["true_iou"] = Rounded(record.true_iou, 1e-4);
    json["model_true_iou"] = Rounded(record.model_true_iou, 1e-4);
  }
  return json;
}

Json RefinementJson(const RefinementRecord& record) {
  Json json = {{"pose", RefinementStateName(record.pose_state)},
               {"pose_support", Rounded(record.pose_support, 1e-3)},
               {"surface", RefinementStateName(record.surface_state)},
               {"surface_support", Rounded(record.surface_support, 1e-3)}};
  if (std::isfinite(record.surface_true_iou)) {
    json["batch_true_iou"] = Rounded(record.batch_true_iou, 1e-4);
    json["surface_true_iou"] = Rounded(record.surface_true_iou, 1e-4);
  }
  return json;
}

// Over all frames that have a value; null without any.
Json IouJson(const std::vector<double>& iou) {
  const IouSummary all = SummarizeIou(iou);
  if (all.num_frames == 0) return nullptr;
  return {{"mean", all.mean}, {"worst_decile", all.worst_decile}, {"frames", all.num_frames}};
}

// The same of records. `iou` gives that of a record.
template <typename Record, typename Iou>
Json TrueIouJson(const std::vector<Record>& records, const Iou& iou) {
  std::vector<double> values;
  values.reserve(records.size());
  for (const Record& record : records) values.push_back(iou(record));
  return IouJson(values);
}

// File names need not be UTF-8; what is not is replaced rather than refused.
void WriteJson(const std::filesystem::path& path, const Json& json) {
  WriteFileAtomically(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace

void WriteReport(const std::filesystem::path& path, const CaptureInputs& inputs,
                 const CaptureOptions& options, const CaptureReport& report) {
  Json json = {{"format", "mpc-report"}, {"version", 1}, {"complete", report.complete}};
  json["inputs"] = {{"video", inputs.video.string()},
                    {"actor", inputs.actor.string()},
                    {"camera", inputs.camera},
                    {"fov_rad", inputs.fov_rad},
                    {"detections2d", inputs.detections2d.string()},
                    {"detections3d", inputs.detections3d.string()},
                    {"masks", inputs.masks.string()},
                    {"true_masks", inputs.true_masks.string()}};
  json["options"] = {{"pose", PoseOptionsJson(options.pose)},
                     {"height_m", options.height_m},
                     {"overlay", options.overlay},
                     {"masks", options.masks},
                     {"person_masks", options.person_masks},
                     {"detect_every", options.detect.every},
                     {"average_mirrored", options.detect.landmarker.average_mirrored}};
  json["outputs"] = report.outputs;
  json["fps"] = report.fps;
  json["num_frames"] = report.num_frames;
  json["camera"] = CameraJson(report.camera);
  if (std::isfinite(report.focal_uncertainty)) {
    json["camera"]["focal_uncertainty"] = report.focal_uncertainty;
    if (report.focal_35mm > 0) json["camera"]["focal_35mm"] = report.focal_35mm;
  }
  json["world"] = WorldJson(report.world);
  json["proportions"] = ProportionsJson(report);
  json["mapping"] = MappingJson(report);
  json["warnings"] = report.warnings;
  for (const StageSeconds& timing : report.timings) {
    json["seconds"][timing.stage] = Rounded(timing.seconds, 1e-3);
    json["core_seconds"][timing.stage] = Rounded(timing.core_seconds, 1e-3);
  }
  if (!report.person_iou.empty()) {
    json["person_iou"] = IouJson(report.person_iou);
  }
  json["num_windows"] = report.track.num_windows;
  json["error_2d_mm"] = report.track.error_2d_mm;
  if (!inputs.true_masks.empty()) {
    const auto summary = [&](const auto& iou) { return TrueIouJson(report.refinement, iou); };
    using Record = RefinementRecord;
    json["true_iou"] = {
        {"silhouettes", summary([](const Record& r) { return r.silhouette.true_iou; })},
        {"batch", summary([](const Record& r) { return r.batch_true_iou; })},
        {"model", summary([](const Record& r) { return r.silhouette.model_true_iou; })},
        {"surface", summary([](const Record& r) { return r.surface_true_iou; })}};
  }
  if (report.surface.num_targets > 0) {
    json["surface"] = {{"morph_targets", report.surface.num_targets},
                       {"mean_error_mm", Rounded(1000 * report.surface.mean_m, 1e-4)},
                       {"max_error_mm", Rounded(1000 * report.surface.max_m, 1e-4)}};
  }
  Json joints = Json::array();
  for (const SkeletonJoint& joint : report.skeleton.joints) joints.push_back(JointName(joint.id));
  json["joints"] = std::move(joints);
  Json frames = Json::array();
  for (size_t f = 0; f < report.track.frames.size(); ++f) {
    Json frame = FrameJson(report.track.frames[f], static_cast<double>(f) / report.fps);
    if (f < report.refinement.size()) {
      frame["silhouette"] = SilhouetteJson(report.refinement[f].silhouette);
      frame["refinement"] = RefinementJson(report.refinement[f]);
    }
    if (f < report.world.moving_world_from_camera.size()) {
      frame["world_from_camera"] = Transform(report.world.moving_world_from_camera[f]);
    }
    frames.push_back(std::move(frame));
  }
  json["frames"] = std::move(frames);
  WriteJson(path, json);
}

void WriteSilhouetteReport(const std::filesystem::path& path, const Take& take,
                           const SegmentReport& report) {
  Json json = {
      {"format", "mpc-silhouettes"},
      {"version", 1},
      {"complete", report.complete},
      {"video", take.video.string()},
      {"actor", take.actor.string()},
      {"outputs", report.outputs},
      {"num_frames", report.frames.size()},
      {"warnings", report.warnings},
      {"true_iou",
       {{"silhouettes", TrueIouJson(report.frames, std::mem_fn(&SilhouetteRecord::true_iou))},
        {"model", TrueIouJson(report.frames, std::mem_fn(&SilhouetteRecord::model_true_iou))}}}};
  Json frames = Json::array();
  for (const SilhouetteRecord& record : report.frames) frames.push_back(SilhouetteJson(record));
  json["frames"] = std::move(frames);
  WriteJson(path, json);
}

}  // namespace mpc::internal
