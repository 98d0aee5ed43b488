// Purpose: the shape of a dressed person as a function of space: joints, and parts that know which
// bone they follow.
// Frames: origin midway between the hips, y up, facing +z, left = +x, T-pose. Units: fractions of
// the height. The body is symmetric: only its left limbs are described.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/capsule_set.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {

// Joints relative to the middle of the hips.
struct BodyFrame {
  double hips_height;
  Eigen::Vector3d spine, chest, neck, head, crown;
  Eigen::Vector3d shoulder, elbow, wrist, fingertip;
  Eigen::Vector3d hip, knee, ankle, ball;
};
BodyFrame MakeBodyFrame(const DressedActorOptions& options);

inline Eigen::Vector3d Mirrored(const Eigen::Vector3d& x) { return {-x.x(), x.y(), x.z()}; }

// The same part on the right side; parts of the middle stay.
RigPart OnRightSide(RigPart part);

enum class HairStyle { kShort, kBob, kBun };

// A rounded body part.
struct Solid {
  enum class Kind { kEllipsoid, kCone, kLoft };
  // A cross-section of a loft: where along the axis, centre and half widths along the two others.
  struct Station {
    double at, u, v, ru, rv;
  };
  RigPart part;
  Kind kind;
  Eigen::Vector3d a, b, radii;  // ellipsoid: centre a, radii; cone: ball radii[0] at a, [1] at b
  int axis = 1;                 // loft: along x (u = y, v = z) or y (u = x, v = z)
  std::vector<Station> stations;
  Eigen::Vector3d box_min, box_max;

  double Distance(const Eigen::Vector3d& x) const;
  Station Section(double at) const;
};

class ActorShape {
 public:
  ActorShape(const DressedActorOptions& options, HairStyle hair);

  const BodyFrame& frame() const { return frame_; }
  // Negative inside; about a distance near the surface.
  double Distance(const Eigen::Vector3d& x) const;
  RigPart NearestPart(const Eigen::Vector3d& x) const;
  bool IsHair(const Eigen::Vector3d& x) const;

  // Heights and places where clothing ends.
  double hem_y() const { return hem_y_; }          // of the shirt
  double cuff_x() const { return cuff_x_; }        // of the sleeves
  double trouser_y() const { return trouser_y_; }  // of the trousers
  double shoe_y() const { return shoe_y_; }
  double waist_y() const { return waist_y_; }

  // Trunk and left leg as capsules, each with the part it follows.
  struct PartCapsule {
    RigPart part;
    Capsule capsule;
  };
  std::vector<PartCapsule> Capsules() const;
  // Half widths of the trunk at a height, and its centre's z in `v`.
  Solid::Station TrunkSection(double y) const { return trunk_section_.Section(y); }

 private:
  void AddHead(HairStyle style, double build);
  void AddTrunk(const DressedActorOptions& options);
  void AddArm(const DressedActorOptions& options);
  void AddLeg(const DressedActorOptions& options);
  double HairDistance(const Eigen::Vector3d& left) const;

  BodyFrame frame_;
  std::vector<Solid> head_, hair_, trunk_, arm_, leg_, shirt_, sleeve_;
  Solid trunk_section_, leg_section_;
  double hem_y_, cuff_x_, trouser_y_, shoe_y_, waist_y_;
};

}  // namespace mpc
