#include "mpc/io/camera_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "camera_json.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {

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
    place["R"].ExpectSize(3);
    place["t"].ExpectSize(3);
    for (size_t i = 0; i < 3; ++i) {
      const JsonPlace row = place["R"][i];
      row.ExpectSize(3);
      for (size_t k = 0; k < 3; ++k) camera.camera_from_world.rotation(i, k) = row[k].Number();
      camera.camera_from_world.translation[static_cast<int>(i)] = place["t"][i].Number();
    }
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
  if (camera.has_extrinsics) {
    const Eigen::Matrix3d& rotation = camera.camera_from_world.rotation;
    const Eigen::Vector3d& translation = camera.camera_from_world.translation;
    for (int i = 0; i < 3; ++i) {
      json["R"].push_back({rotation(i, 0), rotation(i, 1), rotation(i, 2)});
      json["t"].push_back(translation[i]);
    }
  }
  return json;
}

namespace {

using internal::JsonPlace;

constexpr size_t kMaxJsonBytes = size_t{64} << 20;

std::string NameList(const std::vector<Camera>& cameras) {
  std::string list;
  for (const Camera& camera : cameras) list += (list.empty() ? "" : ", ") + camera.name;
  return list;
}

}  // namespace

std::vector<Camera> ReadCameras(const std::filesystem::path& path) {
  const nlohmann::ordered_json json =
      internal::ParseJson(ReadFile(path, kMaxJsonBytes), path.string());
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
  const size_t colon = spec.rfind(':');
  const bool has_name = colon != std::string::npos && !std::filesystem::exists(spec);
  const std::string file = has_name ? spec.substr(0, colon) : spec;
  const std::vector<Camera> cameras = ReadCameras(file);
  if (!has_name) {
    if (cameras.size() == 1) return cameras.front();
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{} holds {} cameras; choose one as {}:NAME, with NAME among {}", file,
                            cameras.size(), file, NameList(cameras)));
  }
  const std::string name = spec.substr(colon + 1);
  const auto it = std::find_if(cameras.begin(), cameras.end(),
                               [&](const Camera& camera) { return camera.name == name; });
  if (it != cameras.end()) return *it;
  throw Error(ErrorCode::kInvalidArgument,
              fmt::format("{} has no camera \"{}\"; it has {}", file, name, NameList(cameras)));
}

void WriteCameras(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Camera& camera : cameras) list.push_back(internal::CameraToJson(camera));
  const nlohmann::ordered_json file = {{"cameras", std::move(list)}};
  WriteFileAtomically(path, file.dump(1) + "\n");
}

}  // namespace mpc
