#include "mpc/take.h"

#include <fmt/format.h>

#include <array>
#include <system_error>

#include "actor.h"
#include "mask_outputs.h"
#include "mpc/core/error.h"
#include "mpc/io/poses_file.h"
#include "mpc/skeleton/proportions.h"
#include "outputs.h"
#include "report.h"

namespace mpc {

namespace fs = std::filesystem;

Take ReadTake(const fs::path& folder, const fs::path& video, const fs::path& actor) {
  const fs::path file = folder / internal::kPosesName;
  CapturedPoses captured = ReadPoses(file);
  Take take;
  take.folder = folder;
  take.video = video.empty() ? captured.video : video;
  take.image_fps = captured.image_fps;
  take.actor = actor.empty() ? captured.actor : actor;
  take.fps = captured.fps;
  take.camera = captured.camera;
  internal::Actor loaded = internal::LoadActor(take.actor, captured.height_m);
  ApplyProportions(captured.proportions, &loaded.character, &loaded.rig);
  take.rig = std::move(loaded.rig);
  take.character = std::move(loaded.character);
  if (internal::DofNames(take.character.skeleton) != captured.dofs) {
    throw Error(ErrorCode::kMismatch, fmt::format("{} has poses of another skeleton than {} has",
                                                  file.string(), take.actor.string()));
  }
  take.poses = std::move(captured.poses);
  return take;
}

SegmentReport SegmentTake(const Take& take, const fs::path& output, const SegmentOptions& options,
                          const ProgressCallback& progress) {
  constexpr const char* kReportName = "silhouettes.json";
  options.silhouettes.Validate();
  // A capture folder's own files belong together; they count as inputs here.
  const std::array<fs::path, 2> inputs = {take.video, options.true_masks};
  internal::PrepareOutput(output, inputs,
                          std::array{internal::kMasksName, internal::kMaskFolderName,
                                     internal::kOverlayName, kReportName});
  std::error_code ec;
  if (fs::exists(output / internal::kPosesName, ec)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} is a capture folder, whose masks and overlay would be overwritten: "
                            "choose another output folder",
                            output.string()));
  }
  for (const char* name : {kReportName, internal::kMasksName, internal::kOverlayName}) {
    fs::remove(output / name, ec);  // of an earlier run
  }
  PosedClip clip = take.clip();
  clip.true_masks = options.true_masks;
  const internal::MaskOutputs files = {
      .video = output / internal::kMasksName,
      .pictures = options.pictures ? output / internal::kMaskFolderName : fs::path(),
      .overlay = options.overlay ? output / internal::kOverlayName : fs::path()};
  SegmentReport report;
  report.frames = internal::WriteMasks(files, take.fps, clip, options.silhouettes, progress);
  report.complete = static_cast<Eigen::Index>(report.frames.size()) == take.poses.cols();
  if (report.complete) {
    report.outputs.push_back(internal::kMasksName);
    if (options.pictures) report.outputs.push_back(internal::kMaskFolderName);
    if (options.overlay) report.outputs.push_back(internal::kOverlayName);
  }
  internal::AddSilhouetteWarnings(report.frames, &report.warnings);
  report.outputs.push_back(kReportName);
  internal::WriteSilhouetteReport(output / kReportName, take, report);
  return report;
}

}  // namespace mpc
