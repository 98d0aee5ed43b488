#include "mpc/io/detections_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "json_file.h"
#include "mpc/core/blazepose.h"
#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"
#include "openpose_joint.h"

namespace mpc {
namespace {

using internal::JsonPlace;
using internal::OpenPoseJoint;

constexpr const char* kDetectionsFormat = "mpc-detections";
constexpr int kDetectionsVersion = 1;

enum class FileKind { kOpenPose, kBlazePose, kOwn };

FileKind KindOf(const JsonPlace& root) {
  if (root.Has("format") && !root.Has("frames") && !root.Has("det")) {
    root.Fail("has a format but no frames");
  }
  if (root.Has("names") && root.Has("det")) return FileKind::kOpenPose;
  if (root.Has("joints") && root.Has("frames")) return FileKind::kOwn;
  if (root.Has("frames")) return FileKind::kBlazePose;
  root.Fail(
      "is no detection file: expected OpenPose (names, det), BlazePose (frames with persons) or "
      "mpc-detections (format, joints, frames)");
}

[[noreturn]] void ThrowNot(const std::filesystem::path& path, const char* what) {
  throw Error(ErrorCode::kUnsupported, fmt::format("{} has no {}", path.string(), what));
}

double Confidence(const JsonPlace& place) {
  const double confidence = place.Number();
  if (confidence < 0 || confidence > 1.5) {
    place.Fail(fmt::format("is {}, expected a confidence in [0, 1]", confidence));
  }
  return std::min(confidence, 1.0);
}

// ---- OpenPose ------------------------------------------------------------------------------

Detections2d ReadOpenPose(const JsonPlace& root) {
  Detections2d detections;
  if (root.Has("width")) detections.width = root["width"].Int();
  if (root.Has("height")) detections.height = root["height"].Int();
  const JsonPlace names = root["names"];
  std::vector<size_t> columns;  // of the file, for each joint kept
  for (size_t i = 0; i < names.Size(); ++i) {
    const std::optional<JointId> joint = OpenPoseJoint(names[i].String());
    if (!joint) continue;
    if (FindColumn(detections.joints, *joint) >= 0) names[i].Fail("repeats a name");
    detections.joints.push_back(*joint);
    columns.push_back(i);
  }
  if (columns.empty()) names.Fail("has no known joint");

  const int num_joints = static_cast<int>(columns.size());
  const JsonPlace det = root["det"];
  for (size_t f = 0; f < det.Size(); ++f) {
    Detections2d::Frame frame{Eigen::Matrix2Xd::Zero(2, num_joints),
                              Eigen::VectorXd::Zero(num_joints)};
    const JsonPlace row = det[f];
    if (!row.IsNull()) {
      row.ExpectSize(names.Size());
      for (int j = 0; j < num_joints; ++j) {
        const JsonPlace entry = row[columns[static_cast<size_t>(j)]];
        if (entry.IsNull()) continue;
        entry.ExpectSize(3);
        frame.pixels.col(j) << entry[0].Number(), entry[1].Number();
        frame.confidence[j] = Confidence(entry[2]);
      }
    }
    detections.frames.push_back(std::move(frame));
  }
  return detections;
}

// ---- BlazePose -----------------------------------------------------------------------------

constexpr size_t kNumLandmarks = kNumBlazePoseLandmarks;

double BoxArea(const JsonPlace& person) {
  const JsonPlace landmarks = person["landmarks"];
  landmarks.ExpectSize(kNumLandmarks);
  Eigen::Array2d lo = Eigen::Array2d::Constant(1e300);
  Eigen::Array2d hi = -lo;
  for (size_t i = 0; i < kNumLandmarks; ++i) {
    const Eigen::Array2d pixel(landmarks[i][0].Number(), landmarks[i][1].Number());
    lo = lo.min(pixel);
    hi = hi.max(pixel);
  }
  return (hi - lo).prod();
}

// For every frame the index of the person to follow, or -1.
std::vector<int> ChoosePersons(const JsonPlace& frames) {
  std::map<int, double> area_of_id;
  bool all_have_ids = true;
  for (size_t f = 0; f < frames.Size(); ++f) {
    if (frames[f].Has("frame") && frames[f]["frame"].Int() != static_cast<int>(f)) {
      frames[f].Fail(fmt::format("has frame number {}, expected {} (one entry per video frame)",
                                 frames[f]["frame"].Int(), f));
    }
    const JsonPlace persons = frames[f]["persons"];
    for (size_t p = 0; p < persons.Size(); ++p) {
      all_have_ids = all_have_ids && persons[p].Has("id");
      if (all_have_ids) area_of_id[persons[p]["id"].Int()] += BoxArea(persons[p]);
    }
  }
  const auto largest = std::max_element(area_of_id.begin(), area_of_id.end(),
                                        [](auto& a, auto& b) { return a.second < b.second; });
  std::vector<int> chosen(frames.Size(), -1);
  for (size_t f = 0; f < frames.Size(); ++f) {
    const JsonPlace persons = frames[f]["persons"];
    double best_area = -1;
    for (size_t p = 0; p < persons.Size(); ++p) {
      if (all_have_ids && persons[p]["id"].Int() != largest->first) continue;
      const double area = BoxArea(persons[p]);
      if (area > best_area) {
        best_area = area;
        chosen[f] = static_cast<int>(p);
      }
    }
  }
  return chosen;
}

// Reads D coordinates per landmark from `field` of the chosen person of every frame and hands the
// joints of each frame to `add`.
template <int D, typename Add>
void ReadBlazePose(const JsonPlace& root, const char* field, const Add& add) {
  const JsonPlace frames = root["frames"];
  const std::vector<int> chosen = ChoosePersons(frames);
  const int num_joints = static_cast<int>(BlazePoseJoints().size());
  for (size_t f = 0; f < frames.Size(); ++f) {
    Eigen::Matrix<double, D, Eigen::Dynamic> positions;
    positions.setZero(D, num_joints);
    Eigen::VectorXd confidence = Eigen::VectorXd::Zero(num_joints);
    if (chosen[f] >= 0) {
      const JsonPlace person = frames[f]["persons"][static_cast<size_t>(chosen[f])];
      const JsonPlace points = person[field];
      points.ExpectSize(kNumLandmarks);
      Eigen::Matrix<double, D, kNumBlazePoseLandmarks> x;
      Eigen::Vector<double, kNumBlazePoseLandmarks> c;
      for (size_t i = 0; i < kNumLandmarks; ++i) {
        for (size_t d = 0; d < D; ++d) x(static_cast<int>(d), i) = points[i][d].Number();
        const JsonPlace landmark = person["landmarks"][i];
        landmark.ExpectSize(5);
        c[static_cast<int>(i)] = Confidence(landmark[3]) * Confidence(landmark[4]);
      }
      JointsFromBlazePose(x, &positions);
      confidence = JointConfidencesFromBlazePose(c);
    }
    add(std::move(positions), std::move(confidence));
  }
}

// ---- Our own format ------------------------------------------------------------------------

template <int D, typename Detections, typename Add>
void ReadOwn(const JsonPlace& root, const std::filesystem::path& path, Detections* detections,
             const Add& add) {
  if (!root.Has("format") || root["format"].String() != kDetectionsFormat) {
    root.Fail(fmt::format("has no format \"{}\"", kDetectionsFormat));
  }
  if (root["version"].Int() != kDetectionsVersion) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{}: version {} of {}, only {} is supported", path.string(),
                            root["version"].Int(), kDetectionsFormat, kDetectionsVersion));
  }
  if (root["dimensions"].Int() != D) {
    ThrowNot(path, D == 2 ? "2D detections (its dimensions are 3)"
                          : "3D detections (its dimensions are 2)");
  }
  const JsonPlace names = root["joints"];
  for (size_t j = 0; j < names.Size(); ++j) {
    const std::optional<JointId> joint = FindJoint(names[j].String());
    if (!joint) names[j].Fail(fmt::format("is \"{}\", not a joint name", names[j].String()));
    if (FindColumn(detections->joints, *joint) >= 0) names[j].Fail("repeats a joint");
    detections->joints.push_back(*joint);
  }
  const int num_joints = static_cast<int>(names.Size());
  const JsonPlace frames = root["frames"];
  for (size_t f = 0; f < frames.Size(); ++f) {
    Eigen::Matrix<double, D, Eigen::Dynamic> positions;
    positions.setZero(D, num_joints);
    Eigen::VectorXd confidence = Eigen::VectorXd::Zero(num_joints);
    if (!frames[f].IsNull()) {
      frames[f].ExpectSize(names.Size());
      for (int j = 0; j < num_joints; ++j) {
        const JsonPlace entry = frames[f][static_cast<size_t>(j)];
        if (entry.IsNull()) continue;
        entry.ExpectSize(D + 1);
        for (size_t d = 0; d < D; ++d) positions(static_cast<int>(d), j) = entry[d].Number();
        confidence[j] = Confidence(entry[D]);
      }
    }
    add(std::move(positions), std::move(confidence));
  }
}

template <typename Detections>
std::string OwnHeader(const Detections& detections, int dimensions) {
  std::string text = fmt::format("{{\n\"format\": \"{}\",\n\"version\": {},\n\"dimensions\": {},\n",
                                 kDetectionsFormat, kDetectionsVersion, dimensions);
  text += "\"joints\": [";
  for (size_t j = 0; j < detections.joints.size(); ++j) {
    text += fmt::format("{}\"{}\"", j ? ", " : "", JointName(detections.joints[j]));
  }
  return text + "],\n";
}

template <typename Frames, typename Entry>
std::string OwnFrames(const Frames& frames, int num_joints, const Entry& entry) {
  std::string text = "\"frames\": [";
  for (size_t f = 0; f < frames.size(); ++f) {
    text += f ? ",\n" : "\n";
    if (!(frames[f].confidence.array() > 0).any()) {
      text += "null";
      continue;
    }
    for (int j = 0; j < num_joints; ++j) {
      text += j ? ", " : "[";
      text += frames[f].confidence[j] > 0 ? entry(frames[f], j) : "null";
    }
    text += "]";
  }
  return text + "\n]\n}\n";
}

nlohmann::ordered_json ReadJson(const std::filesystem::path& path) {
  return internal::ParseJson(ReadFile(path), path.string());
}

template <typename Detections>
Detections Checked(Detections detections, const JsonPlace& root) {
  if (detections.frames.empty()) root.Fail("has no frame");
  try {
    detections.Validate();
  } catch (const Error& e) {
    root.Fail(e.what());
  }
  return detections;
}

}  // namespace

Detections2d ReadDetections2d(const std::filesystem::path& path) {
  const nlohmann::ordered_json json = ReadJson(path);
  const JsonPlace root(json, path.string());
  Detections2d detections;
  const auto add = [&](Eigen::Matrix2Xd pixels, Eigen::VectorXd confidence) {
    detections.frames.push_back({std::move(pixels), std::move(confidence)});
  };
  switch (KindOf(root)) {
    case FileKind::kOpenPose:
      detections = ReadOpenPose(root);
      break;
    case FileKind::kBlazePose:
      detections.joints = BlazePoseJoints();
      ReadBlazePose<2>(root, "landmarks", add);
      break;
    case FileKind::kOwn:
      ReadOwn<2>(root, path, &detections, add);
      break;
  }
  if (root.Has("width")) detections.width = root["width"].Int();
  if (root.Has("height")) detections.height = root["height"].Int();
  return Checked(std::move(detections), root);
}

Detections3d ReadDetections3d(const std::filesystem::path& path) {
  const nlohmann::ordered_json json = ReadJson(path);
  const JsonPlace root(json, path.string());
  Detections3d detections;
  const auto add = [&](Eigen::Matrix3Xd positions, Eigen::VectorXd confidence) {
    detections.frames.push_back({std::move(positions), std::move(confidence)});
  };
  switch (KindOf(root)) {
    case FileKind::kOpenPose:
      ThrowNot(path, "3D detections (OpenPose files are 2D)");
    case FileKind::kBlazePose:
      detections.joints = BlazePoseJoints();
      detections.ray_aligned = true;
      ReadBlazePose<3>(root, "world", add);
      break;
    case FileKind::kOwn: {
      const std::string axes = root.Has("axes") ? root["axes"].String() : "camera";
      if (axes != "camera" && axes != "ray") {
        root["axes"].Fail(fmt::format("is \"{}\", expected \"camera\" or \"ray\"", axes));
      }
      detections.ray_aligned = axes == "ray";
      ReadOwn<3>(root, path, &detections, add);
      break;
    }
  }
  return Checked(std::move(detections), root);
}

void WriteDetections(const std::filesystem::path& path, const Detections2d& detections) {
  detections.Validate();
  std::string text = OwnHeader(detections, 2);
  text += fmt::format("\"width\": {},\n\"height\": {},\n", detections.width, detections.height);
  text += OwnFrames(detections.frames, static_cast<int>(detections.joints.size()),
                    [](const Detections2d::Frame& frame, int j) {
                      return fmt::format("[{:.4f}, {:.4f}, {:.6f}]", frame.pixels(0, j),
                                         frame.pixels(1, j), frame.confidence[j]);
                    });
  WriteFileAtomically(path, text);
}

void WriteDetections(const std::filesystem::path& path, const Detections3d& detections) {
  detections.Validate();
  std::string text = OwnHeader(detections, 3);
  text += fmt::format("\"axes\": \"{}\",\n", detections.ray_aligned ? "ray" : "camera");
  text += OwnFrames(detections.frames, static_cast<int>(detections.joints.size()),
                    [](const Detections3d::Frame& frame, int j) {
                      return fmt::format("[{:.6f}, {:.6f}, {:.6f}, {:.6f}]", frame.positions(0, j),
                                         frame.positions(1, j), frame.positions(2, j),
                                         frame.confidence[j]);
                    });
  WriteFileAtomically(path, text);
}

}  // namespace mpc
