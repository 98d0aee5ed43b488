// Purpose: OpenPose's joint names (BODY_25 and BODY_25B), as detections and truth files use them.
#pragma once

#include <optional>
#include <string_view>

#include "mpc/core/joints.h"

namespace mpc::internal {

// Empty for a name that is none of our joints.
std::optional<JointId> OpenPoseJoint(std::string_view name);

}  // namespace mpc::internal
