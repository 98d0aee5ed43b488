#include "mpc/io/poses_file.h"

#include <fmt/format.h>

#include "camera_json.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

using internal::JsonPlace;
using Json = nlohmann::ordered_json;

constexpr const char* kPosesFormat = "mpc-poses";
constexpr int kPosesVersion = 1;
constexpr int kMaxDofs = 10000;

Proportions ParseProportions(const JsonPlace& place) {
  Proportions proportions;
  proportions.overall = place["overall"].Number();
  const JsonPlace parts = place["parts"];
  for (int p = 0; p < kNumBodyParts; ++p) {
    proportions.part[static_cast<size_t>(p)] =
        parts[BodyPartName(static_cast<BodyPart>(p))].Number();
  }
  return proportions;
}

Json ProportionsJson(const Proportions& proportions) {
  Json parts = Json::object();
  for (int p = 0; p < kNumBodyParts; ++p) {
    parts[BodyPartName(static_cast<BodyPart>(p))] = proportions.part[static_cast<size_t>(p)];
  }
  return {{"overall", proportions.overall}, {"parts", std::move(parts)}};
}

Eigen::MatrixXd ParsePoses(const JsonPlace& frames, size_t num_dofs) {
  Eigen::MatrixXd poses(num_dofs, frames.Size());
  for (Eigen::Index f = 0; f < poses.cols(); ++f) {
    const JsonPlace pose = frames[static_cast<size_t>(f)];
    pose.ExpectSize(num_dofs);
    for (size_t n = 0; n < num_dofs; ++n) {
      poses(static_cast<Eigen::Index>(n), f) = pose[n].Number();
    }
  }
  return poses;
}

}  // namespace

CapturedPoses ReadPoses(const std::filesystem::path& path) {
  const Json json = internal::ParseJson(ReadFile(path), path.string());
  const JsonPlace root(json, path.string());
  if (!root.Has("format") || root["format"].String() != kPosesFormat) {
    root.Fail(fmt::format("has no format \"{}\"", kPosesFormat));
  }
  if (root["version"].Int() != kPosesVersion) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: version {} of {}, only {} is supported", path.string(),
                            root["version"].Int(), kPosesFormat, kPosesVersion));
  }
  CapturedPoses captured;
  captured.video = root["video"].String();
  captured.image_fps = root["image_fps"].Number();
  captured.actor = root["actor"].String();
  captured.height_m = root["height_m"].Number();
  captured.proportions = ParseProportions(root["proportions"]);
  captured.fps = root["fps"].Number();
  if (captured.fps <= 0) root["fps"].Fail("is not above 0");
  captured.camera = internal::ParseCamera(root["camera"], 0);
  const JsonPlace dofs = root["dofs"];
  for (size_t n = 0; n < dofs.Size(); ++n) captured.dofs.push_back(dofs[n].String());
  if (captured.dofs.size() < 6 || captured.dofs.size() > kMaxDofs) {
    dofs.Fail(fmt::format("has {} entries, expected 6 to {}", captured.dofs.size(), kMaxDofs));
  }
  captured.poses = ParsePoses(root["frames"], captured.dofs.size());
  return captured;
}

void WritePoses(const std::filesystem::path& path, const CapturedPoses& captured) {
  if (captured.poses.rows() != static_cast<Eigen::Index>(captured.dofs.size()) ||
      !captured.poses.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: poses of {} numbers for {} dofs, or not finite", path.string(),
                            captured.poses.rows(), captured.dofs.size()));
  }
  const Json header = {{"format", kPosesFormat},
                       {"version", kPosesVersion},
                       {"video", captured.video.string()},
                       {"image_fps", captured.image_fps},
                       {"actor", captured.actor.string()},
                       {"height_m", captured.height_m},
                       {"proportions", ProportionsJson(captured.proportions)},
                       {"fps", captured.fps},
                       {"camera", internal::CameraToJson(captured.camera)},
                       {"dofs", captured.dofs}};
  // File names need not be UTF-8; what is not is replaced rather than refused.
  std::string text = header.dump(1, ' ', false, Json::error_handler_t::replace);
  text.resize(text.size() - 2);  // the last line's end and bracket
  text += ",\n \"frames\": [";
  for (Eigen::Index f = 0; f < captured.poses.cols(); ++f) {
    text += f == 0 ? "\n  " : ",\n  ";  // a line per frame
    const Eigen::VectorXd pose = captured.poses.col(f);
    text += Json(std::vector<double>(pose.begin(), pose.end())).dump();
  }
  WriteFileAtomically(path, text + "\n ]\n}\n");
}

}  // namespace mpc
