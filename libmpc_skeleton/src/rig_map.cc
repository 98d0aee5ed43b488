#include "mpc/skeleton/rig_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <tuple>
#include <unordered_map>

#include "mpc/core/error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr const char* kPartNames[kNumRigParts] = {"hips",
                                                  "spine",
                                                  "chest",
                                                  "neck",
                                                  "head",
                                                  "left_upper_arm",
                                                  "left_lower_arm",
                                                  "left_hand",
                                                  "right_upper_arm",
                                                  "right_lower_arm",
                                                  "right_hand",
                                                  "left_upper_leg",
                                                  "left_lower_leg",
                                                  "left_foot",
                                                  "left_toes",
                                                  "right_upper_leg",
                                                  "right_lower_leg",
                                                  "right_foot",
                                                  "right_toes"};

using Names = std::vector<std::string>;

// Normalised bone names of one convention; '#' stands for the side's token. Names of the same part
// are alternatives. Any prefix shared by the whole rig ("mixamorig:", "DEF-") is found by itself.
struct Convention {
  std::string name;
  std::string left;
  std::string right;
  Names hips, spine, chest, neck, head;
  Names upper_arm, lower_arm, hand;
  Names upper_leg, lower_leg, foot, toes;
};

const std::vector<Convention>& Conventions() {
  static const std::vector<Convention> conventions = {
      {.name = "Mixamo or Ready Player Me",
       .left = "left",
       .right = "right",
       .hips = {"hips"},
       .spine = {"spine"},
       .chest = {"spine2"},
       .neck = {"neck"},
       .head = {"head"},
       .upper_arm = {"#arm"},
       .lower_arm = {"#forearm"},
       .hand = {"#hand"},
       .upper_leg = {"#upleg"},
       .lower_leg = {"#leg"},
       .foot = {"#foot"},
       .toes = {"#toebase"}},
      {.name = "VRM",
       .left = "l",
       .right = "r",
       .hips = {"chips"},
       .spine = {"cspine"},
       .chest = {"cchest", "cupperchest"},
       .neck = {"cneck"},
       .head = {"chead"},
       .upper_arm = {"#upperarm"},
       .lower_arm = {"#lowerarm"},
       .hand = {"#hand"},
       .upper_leg = {"#upperleg"},
       .lower_leg = {"#lowerleg"},
       .foot = {"#foot"},
       .toes = {"#toebase"}},
      {.name = "Unity or VRM humanoid",
       .left = "left",
       .right = "right",
       .hips = {"hips"},
       .spine = {"spine"},
       .chest = {"chest", "upperchest"},
       .neck = {"neck"},
       .head = {"head"},
       .upper_arm = {"#upperarm"},
       .lower_arm = {"#lowerarm"},
       .hand = {"#hand"},
       .upper_leg = {"#upperleg"},
       .lower_leg = {"#lowerleg"},
       .foot = {"#foot"},
       .toes = {"#toes"}},
      {.name = "Rigify",
       .left = "l",
       .right = "r",
       .hips = {"spine"},
       .spine = {"spine001"},
       .chest = {"spine003"},
       .neck = {"spine004"},
       .head = {"spine006"},
       .upper_arm = {"upperarm#"},
       .lower_arm = {"forearm#"},
       .hand = {"hand#"},
       .upper_leg = {"thigh#"},
       .lower_leg = {"shin#"},
       .foot = {"foot#"},
       .toes = {"toe#"}},
      {.name = "Unreal or MakeHuman game rig",
       .left = "l",
       .right = "r",
       .hips = {"pelvis"},
       .spine = {"spine01"},
       .chest = {"spine03", "spine02"},
       .neck = {"neck01", "neck"},
       .head = {"head"},
       .upper_arm = {"upperarm#"},
       .lower_arm = {"lowerarm#"},
       .hand = {"hand#"},
       .upper_leg = {"thigh#"},
       .lower_leg = {"calf#"},
       .foot = {"foot#"},
       .toes = {"ball#"}},
  };
  return conventions;
}

Names WithSide(const Names& names, const std::string& side) {
  Names result = names;
  for (std::string& name : result) name.replace(name.find('#'), 1, side);
  return result;
}

// Alternatives per part, in RigPart order.
std::array<Names, kNumRigParts> PartTable(const Convention& c) {
  return {c.hips,
          c.spine,
          c.chest,
          c.neck,
          c.head,
          WithSide(c.upper_arm, c.left),
          WithSide(c.lower_arm, c.left),
          WithSide(c.hand, c.left),
          WithSide(c.upper_arm, c.right),
          WithSide(c.lower_arm, c.right),
          WithSide(c.hand, c.right),
          WithSide(c.upper_leg, c.left),
          WithSide(c.lower_leg, c.left),
          WithSide(c.foot, c.left),
          WithSide(c.toes, c.left),
          WithSide(c.upper_leg, c.right),
          WithSide(c.lower_leg, c.right),
          WithSide(c.foot, c.right),
          WithSide(c.toes, c.right)};
}

// Lower case, letters and digits only, without a namespace ("ns:name").
std::string Normalised(std::string_view name) {
  const size_t colon = name.rfind(':');
  if (colon != std::string_view::npos) name.remove_prefix(colon + 1);
  std::string result;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte)) result += static_cast<char>(std::tolower(byte));
  }
  return result;
}

// Per bone: number of ancestors.
std::vector<int> BoneDepths(const RigAsset& rig) {
  std::vector<int> depths(rig.bones.size(), -1);
  std::vector<int> path;
  for (int start = 0; start < static_cast<int>(rig.bones.size()); ++start) {
    int b = start;
    for (; b >= 0 && depths[b] < 0; b = rig.bones[b].parent) path.push_back(b);
    int depth = b < 0 ? -1 : depths[b];
    for (; !path.empty(); path.pop_back()) depths[path.back()] = ++depth;
  }
  return depths;
}

// Per bone: whether any vertex follows it.
std::vector<bool> WeightedBones(const RigAsset& rig) {
  std::vector<bool> weighted(rig.bones.size(), false);
  for (const RigMesh& mesh : rig.meshes) {
    for (Eigen::Index i = 0; i < mesh.weights.size(); ++i) {
      if (mesh.weights(i) > 0) weighted[mesh.bones(i)] = true;
    }
  }
  return weighted;
}

// A map under trial. Better: more required parts, more of them deforming the mesh, more parts in
// all, a shorter prefix.
struct Candidate {
  RigMap map;
  std::tuple<int, int, int, int> score;
};

// Notes where the sides of the names contradict the geometry.
void CheckSides(const RigAsset& rig, RigMap* map) {
  const auto at = [&](RigPart part) -> Vector3d {
    return rig.bones[(*map)[part]].scene_from_bone.translation();
  };
  const Vector3d hips = at(RigPart::kLeftUpperLeg) - at(RigPart::kRightUpperLeg);
  if (hips.dot(at(RigPart::kLeftUpperArm) - at(RigPart::kRightUpperArm)) < 0) {
    map->notes.push_back("the left arm lies on the side of the right leg");
  }
  if ((*map)[RigPart::kLeftToes] < 0 || (*map)[RigPart::kRightToes] < 0) return;
  const Vector3d forward = at(RigPart::kLeftToes) - at(RigPart::kLeftFoot) +
                           at(RigPart::kRightToes) - at(RigPart::kRightFoot);
  const Vector3d up = at(RigPart::kLeftUpperArm) + at(RigPart::kRightUpperArm) -
                      at(RigPart::kLeftUpperLeg) - at(RigPart::kRightUpperLeg);
  if (hips.dot(up.cross(forward)) < 0) {
    map->notes.push_back(
        "the bones named left lie on the right of a body facing where its feet point: left and "
        "right of the result may be exchanged");
  }
}

}  // namespace

const char* RigPartName(RigPart part) { return kPartNames[static_cast<size_t>(part)]; }

bool IsRequired(RigPart part) {
  switch (part) {
    case RigPart::kSpine:
    case RigPart::kChest:
    case RigPart::kNeck:
    case RigPart::kHead:
    case RigPart::kLeftToes:
    case RigPart::kRightToes:
      return false;
    default:
      return true;
  }
}

RigMap MapRigByNames(const RigAsset& rig) {
  rig.Validate();
  const std::vector<int> depths = BoneDepths(rig);
  // Of bones with the same name, the one highest in the hierarchy.
  std::unordered_map<std::string, int> bone_of_name;
  for (int b = 0; b < static_cast<int>(rig.bones.size()); ++b) {
    const auto [it, inserted] = bone_of_name.try_emplace(Normalised(rig.bones[b].name), b);
    if (!inserted && depths[b] < depths[it->second]) it->second = b;
  }
  const std::vector<bool> weighted = WeightedBones(rig);

  const auto try_prefix = [&](const Convention& convention,
                              const std::array<Names, kNumRigParts>& table,
                              const std::string& prefix) {
    Candidate candidate;
    candidate.map.convention = convention.name;
    int required = 0;
    int deforming = 0;
    int found = 0;
    for (int p = 0; p < kNumRigParts; ++p) {
      int& bone = candidate.map.bone[p];
      bone = -1;
      for (const std::string& name : table[p]) {
        const auto it = bone_of_name.find(prefix + name);
        if (it == bone_of_name.end()) continue;
        if (bone < 0 || depths[it->second] < depths[bone]) bone = it->second;
      }
      if (bone < 0) continue;
      ++found;
      if (IsRequired(static_cast<RigPart>(p))) ++required;
      if (weighted[bone]) ++deforming;
    }
    candidate.score = {required, deforming, found, -static_cast<int>(prefix.size())};
    return candidate;
  };

  Candidate best;
  best.score = {-1, 0, 0, 0};
  for (const Convention& convention : Conventions()) {
    const std::array<Names, kNumRigParts> table = PartTable(convention);
    std::vector<std::string> prefixes = {""};
    for (const std::string& hips : convention.hips) {
      for (const auto& [name, bone] : bone_of_name) {
        if (name.ends_with(hips)) prefixes.push_back(name.substr(0, name.size() - hips.size()));
      }
    }
    std::sort(prefixes.begin(), prefixes.end());
    for (const std::string& prefix : prefixes) {
      Candidate candidate = try_prefix(convention, table, prefix);
      if (candidate.score > best.score) best = std::move(candidate);
    }
  }

  std::vector<std::string> missing;
  for (int p = 0; p < kNumRigParts; ++p) {
    const auto part = static_cast<RigPart>(p);
    if (best.map.bone[p] >= 0) continue;
    if (IsRequired(part)) {
      missing.push_back(RigPartName(part));
    } else {
      best.map.notes.push_back(fmt::format(
          "no {} bone: its place is taken from the bones around it", RigPartName(part)));
    }
  }
  if (!missing.empty()) {
    constexpr size_t kMaxNames = 80;
    std::vector<std::string> names;
    for (size_t b = 0; b < std::min(rig.bones.size(), kMaxNames); ++b) {
      names.push_back(rig.bones[b].name);
    }
    if (rig.bones.size() > kMaxNames) names.push_back("...");
    throw Error(
        ErrorCode::kUnsupported,
        fmt::format(
            "{}: no humanoid recognised by its bone names (nearest convention: {}): no bone "
            "for {}; the rig's {} bones are {}",
            rig.source, best.map.convention, fmt::join(missing, ", "), rig.bones.size(),
            fmt::join(names, ", ")));
  }
  CheckSides(rig, &best.map);
  return best.map;
}

std::string MappingReport(const RigAsset& rig, const RigMap& map) {
  // The part where a bone ends, for its length.
  const auto successor = [](RigPart part) {
    switch (part) {
      case RigPart::kHead:
      case RigPart::kLeftHand:
      case RigPart::kRightHand:
      case RigPart::kLeftToes:
      case RigPart::kRightToes:
        return -1;
      default:
        return static_cast<int>(part) + 1;
    }
  };
  std::string report =
      fmt::format("{}: {} bones, mapped by: {}\n", rig.source, rig.bones.size(), map.convention);
  for (int p = 0; p < kNumRigParts; ++p) {
    const auto part = static_cast<RigPart>(p);
    if (map.bone[p] < 0) {
      report += fmt::format("  {:<16} -\n", RigPartName(part));
      continue;
    }
    const RigBone& bone = rig.bones[map.bone[p]];
    int next = successor(part);
    while (next >= 0 && map.bone[next] < 0) next = successor(static_cast<RigPart>(next));
    std::string length;
    if (next >= 0) {
      const Vector3d end = rig.bones[map.bone[next]].scene_from_bone.translation();
      length = fmt::format("{:7.1f} mm", 1000 * (end - bone.scene_from_bone.translation()).norm());
    }
    report += fmt::format("  {:<16} {:<32}{}\n", RigPartName(part), bone.name, length);
  }
  for (const std::string& note : map.notes) report += fmt::format("  note: {}\n", note);
  return report;
}

}  // namespace mpc
