#include "motion_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "mpc/core/error.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

using enum JointId;

struct Alias {
  JointId joint;                          // the left one of a pair
  std::array<std::string_view, 7> names;  // best first; L stands for the side's spelling
};

// Lower case without separators. Order matters: Mixamo's "LeftShoulder" is a clavicle, so "LArm"
// is asked for first. {L} is replaced by "left"/"right" and by "l"/"r".
constexpr std::array<Alias, 8> kAliases = {{
    {kNeck, {"lowerneck", "neck", "neck1", "neck01"}},
    {kHeadTop, {"head", "headtop"}},
    {kLeftShoulder, {"{L}humerus", "{L}arm", "{L}upperarm", "{L}uparm", "{L}shoulder"}},
    {kLeftElbow, {"{L}radius", "{L}forearm", "{L}lowerarm", "{L}elbow"}},
    {kLeftWrist, {"{L}wrist", "{L}hand", "{L}forearmend"}},
    {kLeftHip, {"{L}femur", "{L}upleg", "{L}upperleg", "{L}thigh", "{L}hip"}},
    {kLeftKnee, {"{L}tibia", "{L}leg", "{L}lowerleg", "{L}shin", "{L}calf", "{L}knee", "{L}shank"}},
    {kLeftAnkle, {"{L}foot", "{L}ankle"}},
}};

std::string Normalised(std::string_view name) {
  // A namespace such as "mixamorig:" is not part of the name.
  if (const size_t colon = name.rfind(':'); colon != std::string_view::npos) {
    name.remove_prefix(colon + 1);
  }
  std::string result;
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c))) {
      result += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
  }
  return result;
}

int FindAlias(const std::vector<std::string>& normalised, const Alias& alias, bool right) {
  for (const std::string_view pattern : alias.names) {
    if (pattern.empty()) continue;
    const bool sided = pattern.starts_with("{L}");
    const std::string stem(sided ? pattern.substr(3) : pattern);
    const std::array<std::string, 2> sides = {right ? "right" : "left", right ? "r" : "l"};
    for (const std::string& side : sides) {
      for (const std::string& name : {sided ? side + stem : stem, sided ? stem + side : stem}) {
        const auto it = std::find(normalised.begin(), normalised.end(), name);
        if (it != normalised.end()) return static_cast<int>(it - normalised.begin());
      }
    }
  }
  return -1;
}

// The descendant of `joint` (or itself) that is farthest from it in the first frame.
int FarEnd(const SourceMotion& source, int joint) {
  const Eigen::Matrix3Xd& positions = source.joint_positions.front();
  std::vector<bool> below(source.names.size(), false);
  below[joint] = true;
  int best = joint;
  double best_distance = 0;
  for (size_t j = joint + 1; j < source.names.size(); ++j) {
    if (source.parents[j] < 0 || !below[source.parents[j]]) continue;
    below[j] = true;
    const double distance = (positions.col(j) - positions.col(joint)).norm();
    if (distance > best_distance) {
      best_distance = distance;
      best = static_cast<int>(j);
    }
  }
  return best;
}

// The far end of the head, or the head joint itself where the end lies beside the line from the
// neck: some files have heads whose end site is not the crown.
int Crown(const SourceMotion& source, int neck, int head) {
  const Eigen::Matrix3Xd& x = source.joint_positions.front();
  const int end = FarEnd(source, head);
  const Eigen::Vector3d below = (x.col(head) - x.col(neck)).normalized();
  const Eigen::Vector3d above = (x.col(end) - x.col(head)).normalized();
  return below.dot(above) > 0.5 ? end : head;
}

// Unit direction per limb of the source in one frame.
LimbDirections FrameDirections(const JointMap& map, const Eigen::Matrix3Xd& positions) {
  LimbDirections directions = LimbDirections::Zero();
  for (int l = 0; l < kNumLimbs; ++l) {
    const Limb& limb = kLimbs[l];
    const std::array<int, 4> joints = {map[limb.from[0]], map[limb.from[1]], map[limb.to[0]],
                                       map[limb.to[1]]};
    if (std::any_of(joints.begin(), joints.end(), [](int j) { return j < 0; })) continue;
    const Eigen::Vector3d vector = 0.5 * (positions.col(joints[2]) + positions.col(joints[3]) -
                                          positions.col(joints[0]) - positions.col(joints[1]));
    if (vector.norm() > 1e-9) directions.col(l) = vector.normalized();
  }
  return directions;
}

// A flat foot's pitch in the source: the median over the quarter of the frames in which the ankle
// is lowest.
double FlatPitch(const SourceMotion& source, const std::vector<LimbDirections>& directions,
                 int foot, int ankle) {
  std::vector<std::pair<double, double>> height_and_pitch;
  for (size_t f = 0; f < directions.size(); ++f) {
    height_and_pitch.emplace_back(source.joint_positions[f](1, ankle),
                                  PitchDown(directions[f].col(foot)));
  }
  std::sort(height_and_pitch.begin(), height_and_pitch.end());
  height_and_pitch.resize(height_and_pitch.size() / 4 + 1);
  const auto middle =
      height_and_pitch.begin() + static_cast<std::ptrdiff_t>(height_and_pitch.size() / 2);
  std::nth_element(height_and_pitch.begin(), middle, height_and_pitch.end(),
                   [](const auto& a, const auto& b) { return a.second < b.second; });
  return std::clamp(middle->second, 0.0, 50 * kDegree);
}

// Where the ankle and the toe tip sit in a foot differs between skeletons, and so does the pitch
// of a foot that stands flat. Turns every foot in the plane of foot and shank by the difference.
void LevelFeet(const SourceMotion& source, const JointMap& map, double flat_pitch_rad,
               std::vector<LimbDirections>* directions) {
  constexpr int kLeftFootLimb = kNumLimbs - 2;
  for (int foot = kLeftFootLimb; foot < kNumLimbs; ++foot) {
    if (map[kLimbs[foot].to[0]] < 0) continue;
    const double pitch = FlatPitch(source, *directions, foot, map[kLimbs[foot].from[0]]);
    for (LimbDirections& frame : *directions) {
      const Eigen::Vector3d shank = frame.col(foot - 2);
      const Eigen::Vector3d toe = frame.col(foot);
      const Eigen::Vector3d axis = shank.cross(toe);
      if (axis.norm() < 0.1) continue;
      frame.col(foot) = Eigen::AngleAxisd(pitch - flat_pitch_rad, axis.normalized()) * toe;
    }
  }
}

}  // namespace

const std::array<Limb, kNumLimbs> kLimbs = {{
    {{kRightHip, kRightHip}, {kLeftHip, kLeftHip}},
    {{kLeftHip, kRightHip}, {kNeck, kNeck}},
    {{kRightShoulder, kRightShoulder}, {kLeftShoulder, kLeftShoulder}},
    {{kNeck, kNeck}, {kHeadTop, kHeadTop}},
    {{kLeftShoulder, kLeftShoulder}, {kLeftElbow, kLeftElbow}},
    {{kRightShoulder, kRightShoulder}, {kRightElbow, kRightElbow}},
    {{kLeftElbow, kLeftElbow}, {kLeftWrist, kLeftWrist}},
    {{kRightElbow, kRightElbow}, {kRightWrist, kRightWrist}},
    {{kLeftHip, kLeftHip}, {kLeftKnee, kLeftKnee}},
    {{kRightHip, kRightHip}, {kRightKnee, kRightKnee}},
    {{kLeftKnee, kLeftKnee}, {kLeftAnkle, kLeftAnkle}},
    {{kRightKnee, kRightKnee}, {kRightAnkle, kRightAnkle}},
    {{kLeftAnkle, kLeftAnkle}, {kLeftToe, kLeftToe}},
    {{kRightAnkle, kRightAnkle}, {kRightToe, kRightToe}},
}};

JointMap MapSourceJoints(const SourceMotion& source) {
  std::vector<std::string> normalised;
  for (const std::string& name : source.names) normalised.push_back(Normalised(name));
  JointMap map;
  for (const Alias& alias : kAliases) {
    map[alias.joint] = FindAlias(normalised, alias, false);
    const JointId mirror = MirrorJoint(alias.joint);
    if (mirror != alias.joint) map[mirror] = FindAlias(normalised, alias, true);
  }
  std::vector<std::string_view> missing;
  for (int j = 0; j < kNumPaperJoints; ++j) {
    const auto id = static_cast<JointId>(j);
    const bool optional = id == kHeadTop || id == kLeftToe || id == kRightToe;
    if (map[id] < 0 && !optional) missing.push_back(JointName(id));
  }
  if (!missing.empty()) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("no joints recognised for {}; the motion's joints are {}",
                            fmt::join(missing, ", "), fmt::join(source.names, ", ")));
  }
  const auto tip = [&](JointId base) {
    const int end = FarEnd(source, map[base]);
    return end == map[base] ? -1 : end;
  };
  map[kHeadTop] = map[kHeadTop] >= 0 ? Crown(source, map[kNeck], map[kHeadTop]) : tip(kNeck);
  map[kLeftToe] = tip(kLeftAnkle);
  map[kRightToe] = tip(kRightAnkle);
  return map;
}

double PitchDown(const Eigen::Vector3d& direction) {
  return std::asin(std::clamp(-direction.y(), -1.0, 1.0));
}

std::vector<LimbDirections> SourceDirections(const SourceMotion& source, const JointMap& map,
                                             double flat_pitch_rad) {
  std::vector<LimbDirections> directions;
  for (const Eigen::Matrix3Xd& positions : source.joint_positions) {
    directions.push_back(FrameDirections(map, positions));
  }
  LevelFeet(source, map, flat_pitch_rad, &directions);
  return directions;
}

}  // namespace mpc
