// Purpose: what the body does in each kind of motion, as a pose for a time. Where it stands comes
// later: heights above the floor and planted feet are made by MakeMotion.
// Frames: world, y up; starts facing +z. Units: seconds, radians.
#pragma once

#include <Eigen/Core>
#include <string>

#include "mpc/eval/motions.h"
#include "mpc/skeleton/skeleton.h"

namespace mpc {

// One pose whose hinges are set by name; angles are clamped to the bounds.
class PoseBuilder {
 public:
  explicit PoseBuilder(const Skeleton& skeleton) : skeleton_(skeleton), pose_(ZeroPose(skeleton)) {}

  void Root(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation);
  // Throws Error (kInvalidArgument) for a hinge that the skeleton does not have.
  void Angle(const std::string& hinge, double angle_rad);
  const Eigen::VectorXd& pose() const { return pose_; }

 private:
  const Skeleton& skeleton_;
  Eigen::VectorXd pose_;
};

// The pose at time t of a motion that lasts `seconds`.
void Act(MotionKind kind, double t, double seconds, PoseBuilder* body);

// When a jumper is in the air.
struct Flight {
  double takeoff_s = 0;
  double landing_s = 0;
};
// The flight of the jump that time t belongs to.
Flight FlightAt(double t);

}  // namespace mpc
