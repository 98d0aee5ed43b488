#include "mpc/io/camera_file.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

#include "camera_json.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

using internal::JsonPlace;

CameraFromWorld ParseExtrinsics(const JsonPlace& place) {
  CameraFromWorld camera_from_world;
  place["R"].ExpectSize(3);
  place["t"].ExpectSize(3);
  for (size_t i = 0; i < 3; ++i) {
    const JsonPlace row = place["R"][i];
    row.ExpectSize(3);
    for (size_t k = 0; k < 3; ++k) camera_from_world.rotation(i, k) = row[k].Number();
    camera_from_world.translation[static_cast<int>(i)] = place["t"][i].Number();
  }
  return camera_from_world;
}

void WriteExtrinsics(const CameraFromWorld& camera_from_world, nlohmann::ordered_json* json) {
  const Eigen::Matrix3d& rotation = camera_from_world.rotation;
  for (int i = 0; i < 3; ++i) {
    (*json)["R"].push_back({rotation(i, 0), rotation(i, 1), rotation(i, 2)});
    (*json)["t"].push_back(camera_from_world.translation[i]);
  }
}

}  // namespace

Camera internal::ParseCamera(const JsonPlace& place, size_t index) {
  Camera camera;
  camera.name = place.Has("name") ? place["name"].String() : fmt::format("camera{}", index);
  camera.width = place["width"].Int();
  camera.height = place["height"].Int();
  camera.fx = place["fx"].Number();
  camera.fy = place["fy"].Number();
  camera.cx = place["cx"].Number();
  camera.cy = place["cy"].Number();
  if (place.Has("dist")) {
    const JsonPlace dist = place["dist"];
    for (size_t k = 0; k < dist.Size(); ++k) {
      const double coefficient = dist[k].Number();
      if (k < camera.distortion.size()) {
        camera.distortion[k] = coefficient;
      } else if (coefficient != 0) {
        throw Error(ErrorCode::kUnsupported,
                    fmt::format("camera {} has {} distortion coefficients, only k1 k2 p1 p2 k3 are "
                                "supported",
                                camera.name, dist.Size()));
      }
    }
  }
  if (place.Has("R") != place.Has("t")) place.Fail("has only one of R and t, expected both");
  if (place.Has("R")) {
    camera.camera_from_world = ParseExtrinsics(place);
    camera.has_extrinsics = true;
  }
  try {
    camera.Validate();
  } catch (const Error& e) {
    place.Fail(fmt::format("({}) is not a camera: {}", camera.name, e.what()));
  }
  return camera;
}

nlohmann::ordered_json internal::CameraToJson(const Camera& camera) {
  camera.Validate();
  nlohmann::ordered_json json = {{"name", camera.name},     {"width", camera.width},
                                 {"height", camera.height}, {"fx", camera.fx},
                                 {"fy", camera.fy},         {"cx", camera.cx},
                                 {"cy", camera.cy},         {"dist", camera.distortion}};
  if (camera.has_extrinsics) WriteExtrinsics(camera.camera_from_world, &json);
  return json;
}

namespace {

constexpr size_t kMaxCameraBytes = size_t{64} << 20;

std::string NameList(const std::vector<Camera>& cameras) {
  std::string list;
  for (const Camera& camera : cameras) list += (list.empty() ? "" : ", ") + camera.name;
  return list;
}

// "file.json" or "file.json:name".
struct CameraSpec {
  std::string file;
  std::optional<std::string> name;
};

CameraSpec SplitSpec(const std::string& spec) {
  const size_t colon = spec.rfind(':');
  if (colon == std::string::npos || std::filesystem::exists(spec)) return {spec, std::nullopt};
  return {spec.substr(0, colon), spec.substr(colon + 1)};
}

size_t FindCamera(const CameraSpec& spec, const std::vector<Camera>& cameras) {
  if (!spec.name) {
    if (cameras.size() == 1) return 0;
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} holds {} cameras; choose one as {}:NAME, with NAME among {}",
                            spec.file, cameras.size(), spec.file, NameList(cameras)));
  }
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].name == *spec.name) return i;
  }
  throw Error(ErrorCode::kInvalidArgument, fmt::format("{} has no camera \"{}\"; it has {}",
                                                       spec.file, *spec.name, NameList(cameras)));
}

}  // namespace

std::vector<Camera> ReadCameras(const std::filesystem::path& path) {
  const nlohmann::ordered_json json =
      internal::ParseJson(ReadFile(path, kMaxCameraBytes), path.string());
  const JsonPlace list = JsonPlace(json, path.string())["cameras"];
  std::vector<Camera> cameras;
  for (size_t i = 0; i < list.Size(); ++i) {
    Camera camera = internal::ParseCamera(list[i], i);
    for (const Camera& other : cameras) {
      if (other.name == camera.name) {
        list[i].Fail(fmt::format("repeats the camera name \"{}\"", camera.name));
      }
    }
    cameras.push_back(std::move(camera));
  }
  if (cameras.empty()) list.Fail("has no camera");
  return cameras;
}

Camera ReadCamera(const std::string& spec) {
  const CameraSpec parts = SplitSpec(spec);
  const std::vector<Camera> cameras = ReadCameras(parts.file);
  return cameras[FindCamera(parts, cameras)];
}

std::vector<CameraFromWorld> ReadCameraMotion(const std::string& spec) {
  const CameraSpec parts = SplitSpec(spec);
  const size_t index = FindCamera(parts, ReadCameras(parts.file));
  const nlohmann::ordered_json json =
      internal::ParseJson(ReadFile(parts.file, kMaxCameraBytes), parts.file);
  const JsonPlace place = JsonPlace(json, parts.file)["cameras"][index];
  std::vector<CameraFromWorld> motion;
  if (!place.Has("frames")) return motion;
  const JsonPlace frames = place["frames"];
  Camera camera = internal::ParseCamera(place, index);
  for (size_t f = 0; f < frames.Size(); ++f) {
    camera.camera_from_world = ParseExtrinsics(frames[f]);
    try {
      camera.Validate();
    } catch (const Error& e) {
      frames[f].Fail(fmt::format("is no place of a camera: {}", e.what()));
    }
    motion.push_back(camera.camera_from_world);
  }
  if (motion.empty()) frames.Fail("has no frame");
  return motion;
}

void WriteMovingCamera(const std::filesystem::path& path, const Camera& camera,
                       const std::vector<CameraFromWorld>& motion) {
  if (motion.empty()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: a moving camera without any frame", path.string()));
  }
  Camera first = camera;
  first.camera_from_world = motion.front();
  first.has_extrinsics = true;
  nlohmann::ordered_json json = internal::CameraToJson(first);
  for (const CameraFromWorld& camera_from_world : motion) {
    first.camera_from_world = camera_from_world;
    first.Validate();
    nlohmann::ordered_json frame;
    WriteExtrinsics(camera_from_world, &frame);
    json["frames"].push_back(std::move(frame));
  }
  const nlohmann::ordered_json file = {{"cameras", nlohmann::ordered_json::array({json})}};
  WriteFileAtomically(path, file.dump(1) + "\n");
}

void WriteCameras(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Camera& camera : cameras) list.push_back(internal::CameraToJson(camera));
  const nlohmann::ordered_json file = {{"cameras", std::move(list)}};
  WriteFileAtomically(path, file.dump(1) + "\n");
}

}  // namespace mpc
