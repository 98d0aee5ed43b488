// Purpose: which bone of somebody's rig plays which part of the capture skeleton.
// Source: naming conventions of Mixamo, VRM humanoid, Ready Player Me, Rigify, Unreal and MakeHuman
// game rigs, Unity humanoid; tables in rig_map.cc.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// A part of a humanoid: the bone that starts there.
enum class RigPart {
  kHips,
  kSpine,
  kChest,
  kNeck,
  kHead,
  kLeftUpperArm,
  kLeftLowerArm,
  kLeftHand,
  kRightUpperArm,
  kRightLowerArm,
  kRightHand,
  kLeftUpperLeg,
  kLeftLowerLeg,
  kLeftFoot,
  kLeftToes,
  kRightUpperLeg,
  kRightLowerLeg,
  kRightFoot,
  kRightToes,
};
inline constexpr int kNumRigParts = 19;

// Name used in reports and JSON, such as "left_upper_arm".
const char* RigPartName(RigPart part);

// Whether a rig without this part cannot be captured: true for hips, upper and lower arms, hands,
// upper and lower legs, feet; false for spine, chest, neck, head, toes.
bool IsRequired(RigPart part);

struct RigMap {
  std::array<int, kNumRigParts> bone{};  // index into RigAsset::bones, -1: not found
  std::string convention;                // the name table that matched, "topology" or "user"
  std::vector<std::string> notes;        // things a user should know, one sentence each

  int operator[](RigPart part) const { return bone[static_cast<size_t>(part)]; }
  int& operator[](RigPart part) { return bone[static_cast<size_t>(part)]; }
};

// Maps by bone-name tables; case, separators and a prefix shared by the rig's bones are ignored. Of
// bones that match the same part, the one highest in the hierarchy wins. Throws Error
// (kUnsupported) listing the required parts that were not found and the bone names that were there.
RigMap MapRigByNames(const RigAsset& rig);

// Human-readable table: part, bone, length of the bone to its successor in mm; then the notes.
std::string MappingReport(const RigAsset& rig, const RigMap& map);

}  // namespace mpc
