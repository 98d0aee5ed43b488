#include "mpc/skeleton/character.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "mpc/core/error.h"
#include "mpc/core/rigid.h"
#include "mpc/core/units.h"
#include "segment_landmarks.h"

namespace mpc {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kUprightTolerance = 20 * kDegree;  // a trunk this close to y counts as upright
constexpr double kClearBend = 10 * kDegree;         // a bend that shows where its hinge axis lies
constexpr double kMinRelativeLength = 0.01;         // shortest limb, as a fraction of the leg

// The rig's joints in the scene frame at bind.
struct BindJoints {
  Vector3d hips;  // midway between the hip joints
  Vector3d up;    // of the body, unit
  Vector3d spine;
  Vector3d neck;
  Vector3d head;
  std::array<Vector3d, 2> upper_arm, lower_arm, hand, upper_leg, lower_leg, foot;  // left, right
  std::array<std::optional<Vector3d>, 2> toes;
  int spine_bone = -1;  // the bone at `spine`, if any
  double height = 0;    // of a body with these bones and average proportions
};

// Where the segments are at bind.
struct BindFrames {
  std::array<Matrix3d, kNumDefaultSegments> rotations;  // scene from segment
  std::array<Vector3d, kNumDefaultSegments> origins;
};

RigPart OnSide(RigPart left, int side) {
  constexpr int kArmParts = 3;
  constexpr int kLegParts = 4;
  const int step = left < RigPart::kLeftUpperLeg ? kArmParts : kLegParts;
  return static_cast<RigPart>(static_cast<int>(left) + side * step);
}

DefaultSegment OnSide(DefaultSegment left, int side) {
  const int step = left < kLeftThighSegment ? kRightUpperArmSegment - kLeftUpperArmSegment
                                            : kRightThighSegment - kLeftThighSegment;
  return static_cast<DefaultSegment>(left + side * step);
}

Vector3d BonePosition(const RigAsset& rig, int bone) {
  return rig.bones[bone].scene_from_bone.translation();
}

std::vector<int> AncestorsAndSelf(const RigAsset& rig, int bone) {
  std::vector<int> chain;
  for (int b = bone; b >= 0; b = rig.bones[b].parent) chain.push_back(b);
  return chain;
}

// Bones of the trunk strictly below (in the body: above) the hips bone: common ancestors of both
// arms, and whatever the map calls spine or chest.
std::vector<int> SpineBones(const RigAsset& rig, const RigMap& map) {
  const std::vector<int> left = AncestorsAndSelf(rig, map[RigPart::kLeftUpperArm]);
  const std::vector<int> right = AncestorsAndSelf(rig, map[RigPart::kRightUpperArm]);
  const std::vector<int> hips = AncestorsAndSelf(rig, map[RigPart::kHips]);
  const auto contains = [](const std::vector<int>& bones, int bone) {
    return std::find(bones.begin(), bones.end(), bone) != bones.end();
  };
  std::vector<int> spine;
  for (const int b : left) {
    if (contains(right, b) && !contains(hips, b)) spine.push_back(b);
  }
  for (const RigPart part : {RigPart::kSpine, RigPart::kChest}) {
    if (map[part] >= 0 && !contains(spine, map[part])) spine.push_back(map[part]);
  }
  return spine;
}

[[noreturn]] void ThrowCoincide(const RigAsset& rig, const std::string& what) {
  throw Error(ErrorCode::kUnsupported,
              fmt::format("{}: cannot fit a skeleton into the rig: {}", rig.source, what));
}

BindJoints FindJoints(const RigAsset& rig, const RigMap& map) {
  BindJoints j;
  const auto both = [&](RigPart left) {
    return std::array<Vector3d, 2>{BonePosition(rig, map[left]),
                                   BonePosition(rig, map[OnSide(left, 1)])};
  };
  j.upper_arm = both(RigPart::kLeftUpperArm);
  j.lower_arm = both(RigPart::kLeftLowerArm);
  j.hand = both(RigPart::kLeftHand);
  j.upper_leg = both(RigPart::kLeftUpperLeg);
  j.lower_leg = both(RigPart::kLeftLowerLeg);
  j.foot = both(RigPart::kLeftFoot);
  for (int side = 0; side < 2; ++side) {
    const int toes = map[OnSide(RigPart::kLeftToes, side)];
    if (toes >= 0) j.toes[side] = BonePosition(rig, toes);
  }
  j.hips = (j.upper_leg[0] + j.upper_leg[1]) / 2;
  const Vector3d shoulders = (j.upper_arm[0] + j.upper_arm[1]) / 2;
  const Vector3d trunk = shoulders - j.hips;
  const double leg = (j.lower_leg[0] - j.upper_leg[0]).norm() + (j.foot[0] - j.lower_leg[0]).norm();
  const double min_length = kMinRelativeLength * leg;

  const auto require_length = [&](const Vector3d& a, const Vector3d& b, const char* part) {
    if (!((a - b).norm() > min_length)) {
      ThrowCoincide(rig, fmt::format("{} has no length (both ends at {:.4f} {:.4f} {:.4f} m)", part,
                                     a.x(), a.y(), a.z()));
    }
  };
  require_length(j.hips, shoulders, "the trunk");
  for (int side = 0; side < 2; ++side) {
    const auto limb = [&](const Vector3d& a, const Vector3d& b, RigPart left) {
      require_length(a, b, RigPartName(OnSide(left, side)));
    };
    limb(j.upper_arm[side], j.lower_arm[side], RigPart::kLeftUpperArm);
    limb(j.lower_arm[side], j.hand[side], RigPart::kLeftLowerArm);
    limb(j.upper_leg[side], j.lower_leg[side], RigPart::kLeftUpperLeg);
    limb(j.lower_leg[side], j.foot[side], RigPart::kLeftLowerLeg);
  }

  // An upright rig stands along y; spines curve, so the trunk's line alone would tilt it.
  const Vector3d trunk_up = trunk.normalized();
  j.up = trunk_up.y() > std::cos(kUprightTolerance) ? Vector3d::UnitY() : trunk_up;
  for (const auto& [pair, part] : {std::pair(&j.upper_leg, "hip"), {&j.upper_arm, "shoulder"}}) {
    const Vector3d across = (*pair)[0] - (*pair)[1];
    if (!(across.cross(j.up).norm() > min_length)) {
      ThrowCoincide(rig, fmt::format("left and right cannot be told apart, the {} joints lie above "
                                     "each other",
                                     part));
    }
  }

  // Proportions of the default skeleton stand in for what the rig does not have.
  const Skeleton average = DefaultSkeleton(1);
  const double average_shoulders = average.segments[kLeftUpperArmSegment].offset.y();
  const double average_trunk = average.segments[kChestSegment].offset.y() + average_shoulders;
  const double average_leg = -average.segments[kLeftShankSegment].offset.y() -
                             average.segments[kLeftFootSegment].offset.y();
  j.height = (trunk.norm() + leg) / (average_trunk + average_leg);
  const double raised =
      (average.segments[kNeckSegment].offset.y() - average_shoulders) / average_trunk;
  j.neck = map[RigPart::kNeck] >= 0 ? BonePosition(rig, map[RigPart::kNeck])
                                    : Vector3d(shoulders + raised * trunk);
  j.head = map[RigPart::kHead] >= 0
               ? BonePosition(rig, map[RigPart::kHead])
               : Vector3d(j.neck + j.height * average.segments[kHeadSegment].offset.y() * j.up);

  const Vector3d ideal_spine = j.hips + (j.neck - j.hips) / 3;
  j.spine = ideal_spine;
  double best = std::numeric_limits<double>::infinity();
  for (const int bone : SpineBones(rig, map)) {
    const double distance = (BonePosition(rig, bone) - ideal_spine).norm();
    if (distance < best) {
      best = distance;
      j.spine_bone = bone;
      j.spine = BonePosition(rig, bone);
    }
  }
  return j;
}

// Axes x = across made level, y = up, z = forward.
Matrix3d UprightFrame(const Vector3d& across, const Vector3d& up) {
  Matrix3d frame;
  frame.col(1) = up;
  frame.col(0) = (across - across.dot(up) * up).normalized();
  frame.col(2) = frame.col(0).cross(frame.col(1));
  return frame;
}

// The frame rotated by the least angle so that its axis `local` points along `direction`.
Matrix3d Aimed(const Matrix3d& frame, const Vector3d& local, const Vector3d& direction) {
  return Eigen::Quaterniond::FromTwoVectors(frame * local, direction) * frame;
}

// Angle from a to b about the unit axis to which both are perpendicular.
double SignedAngle(const Vector3d& a, const Vector3d& b, const Vector3d& axis) {
  return std::atan2(axis.dot(a.cross(b)), a.dot(b));
}

// Frames of a two-bone limb: the upper one is its parent's, aimed along the bone. Where the limb is
// clearly bent, the twist is chosen such that the hinge is perpendicular to the plane of the bend.
void AimLimb(const Matrix3d& parent, const Vector3d& long_axis, const Vector3d& hinge,
             const Vector3d& a, const Vector3d& b, const Vector3d& c, Matrix3d* upper,
             Matrix3d* lower) {
  const Vector3d upper_direction = (b - a).normalized();
  const Vector3d lower_direction = (c - b).normalized();
  *upper = Aimed(parent, long_axis, upper_direction);
  const Vector3d normal = upper_direction.cross(lower_direction);
  const double bend = std::atan2(normal.norm(), upper_direction.dot(lower_direction));
  if (bend > kClearBend && bend < std::numbers::pi - kClearBend) {
    const double twist = SignedAngle(*upper * hinge, normal.normalized(), upper_direction);
    // A larger twist would read hyperextension as flexion.
    if (std::abs(twist) < std::numbers::pi / 2)
      *upper = AngleAxisd(twist, upper_direction) * *upper;
  }
  const Vector3d axis = *upper * hinge;
  const Vector3d in_plane = lower_direction - lower_direction.dot(axis) * axis;
  const double angle =
      in_plane.norm() > 1e-9 ? SignedAngle(upper_direction, in_plane.normalized(), axis) : 0.0;
  *lower = Aimed(AngleAxisd(angle, axis) * *upper, long_axis, lower_direction);
}

// Sole-flat frame of a foot: up with the body, forward to the toes.
Matrix3d FootFrame(const BindJoints& j, int side, const Matrix3d& pelvis,
                   const Eigen::Matrix3Xd& vertices) {
  Vector3d forward = Vector3d::Zero();
  if (j.toes[side]) {
    forward = *j.toes[side] - j.foot[side];
  } else if (vertices.cols() > 0) {
    forward = vertices.rowwise().mean() - j.foot[side];
  }
  forward -= forward.dot(j.up) * j.up;
  constexpr double kMinForward = 0.01;  // of the body's height
  if (forward.norm() < kMinForward * j.height) return pelvis;
  return UprightFrame(j.up.cross(forward), j.up);
}

// Angle about `axis` of the rotation nearest to `rotation`.
double NearestAngle(const Matrix3d& rotation, const Vector3d& axis) {
  const Vector3d skew(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0),
                      rotation(1, 0) - rotation(0, 1));
  return std::atan2(skew.dot(axis), rotation.trace() - axis.dot(rotation * axis));
}

// Angles with rotation = Rot(a, angles[0]) Rot(b, angles[1]) Rot(c, angles[2]) for orthonormal
// axes: of the two solutions the one that violates the hinges' bounds least.
Vector3d ThreeHingeAngles(const Matrix3d& rotation, const Hinge* hinges) {
  const Vector3d& a = hinges[0].axis;
  const Vector3d& b = hinges[1].axis;
  const Vector3d& c = hinges[2].axis;
  const double sign = a.cross(b).dot(c);
  const double sin_b = std::clamp(sign * a.dot(rotation * c), -1.0, 1.0);
  const double y = b.dot(rotation * c);
  const double x = c.dot(rotation * c);
  Vector3d first;
  if (std::hypot(x, y) < 1e-9) {  // the outer axes coincide: all of the turn goes to the first
    first = {std::atan2(sign * c.dot(rotation * b), b.dot(rotation * b)), std::asin(sin_b), 0};
  } else {
    first = {std::atan2(-sign * y, x), std::atan2(sin_b, std::hypot(x, y)),
             std::atan2(-sign * a.dot(rotation * b), a.dot(rotation * a))};
  }
  constexpr double kPi = std::numbers::pi;
  const auto wrap = [](double angle) { return std::remainder(angle, 2 * kPi); };
  const Vector3d second(wrap(first[0] + kPi), wrap(kPi - first[1]), wrap(first[2] + kPi));
  const auto violation = [hinges](const Vector3d& angles) {
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      sum += std::max({0.0, hinges[i].min_rad - angles[i], angles[i] - hinges[i].max_rad});
    }
    return sum;
  };
  return violation(second) < violation(first) ? second : first;
}

// Segment followed by each bone: that of its nearest mapped ancestor or itself.
std::vector<int> BoneSegments(const RigAsset& rig, const RigMap& map, const BindJoints& joints) {
  std::vector<int> segments(rig.bones.size(), -1);
  const auto assign = [&](RigPart part, int segment) {
    if (map[part] >= 0) segments[map[part]] = segment;
  };
  // Trunk bones below the spine's pivot stay with the pelvis.
  const double pivot_height = joints.up.dot(joints.spine);
  for (const int bone : SpineBones(rig, map)) {
    const bool above = joints.up.dot(BonePosition(rig, bone)) >= pivot_height;
    segments[bone] = above || bone == joints.spine_bone ? kChestSegment : kPelvisSegment;
  }
  if (joints.spine_bone < 0) {
    // No spine at all: the shoulders hang on the pelvis bone but belong to the chest.
    for (const RigPart arm : {RigPart::kLeftUpperArm, RigPart::kRightUpperArm}) {
      for (const int b : AncestorsAndSelf(rig, map[arm])) {
        if (b == map[RigPart::kHips]) break;
        segments[b] = kChestSegment;
      }
    }
  }
  assign(RigPart::kHips, kPelvisSegment);
  assign(RigPart::kNeck, kNeckSegment);
  assign(RigPart::kHead, kHeadSegment);
  for (int side = 0; side < 2; ++side) {
    const auto limb = [&](RigPart part, DefaultSegment segment) {
      assign(OnSide(part, side), OnSide(segment, side));
    };
    limb(RigPart::kLeftUpperArm, kLeftUpperArmSegment);
    limb(RigPart::kLeftLowerArm, kLeftForearmSegment);
    limb(RigPart::kLeftHand, kLeftForearmSegment);
    limb(RigPart::kLeftUpperLeg, kLeftThighSegment);
    limb(RigPart::kLeftLowerLeg, kLeftShankSegment);
    limb(RigPart::kLeftFoot, kLeftFootSegment);
    limb(RigPart::kLeftToes, kLeftFootSegment);
  }
  std::vector<int> path;
  for (int start = 0; start < static_cast<int>(rig.bones.size()); ++start) {
    int b = start;
    for (; b >= 0 && segments[b] < 0; b = rig.bones[b].parent) path.push_back(b);
    const int inherited = b < 0 ? static_cast<int>(kPelvisSegment) : segments[b];
    for (; !path.empty(); path.pop_back()) segments[path.back()] = inherited;
  }
  return segments;
}

int NearestBone(const RigAsset& rig, const Vector3d& x) {
  int nearest = 0;
  double best = std::numeric_limits<double>::infinity();
  for (int b = 0; b < static_cast<int>(rig.bones.size()); ++b) {
    const double distance = (BonePosition(rig, b) - x).squaredNorm();
    if (distance < best) {
      best = distance;
      nearest = b;
    }
  }
  return nearest;
}

// Joins the primitives to one mesh whose weights are per segment, the heaviest first.
void BuildMesh(const RigAsset& rig, Character* character) {
  const int num_vertices = rig.num_vertices();
  Eigen::Index num_triangles = 0;
  bool has_uv = true;
  for (const RigMesh& mesh : rig.meshes) {
    num_triangles += mesh.mesh.triangles.cols();
    has_uv = has_uv && mesh.uv.cols() == mesh.mesh.positions.cols();
  }
  character->mesh.positions.resize(3, num_vertices);
  character->mesh.triangles.resize(3, num_triangles);
  character->uv.resize(2, has_uv ? num_vertices : 0);

  using Influence = std::pair<float, int>;  // weight, segment
  std::vector<std::vector<Influence>> influences(num_vertices);
  size_t num_influences = 1;
  Eigen::Index first_vertex = 0;
  Eigen::Index first_triangle = 0;
  for (const RigMesh& mesh : rig.meshes) {
    const Eigen::Index vertices = mesh.mesh.positions.cols();
    const Eigen::Index triangles = mesh.mesh.triangles.cols();
    character->mesh.positions.middleCols(first_vertex, vertices) = mesh.mesh.positions;
    character->mesh.triangles.middleCols(first_triangle, triangles) =
        mesh.mesh.triangles.array() + static_cast<int>(first_vertex);
    if (has_uv) character->uv.middleCols(first_vertex, vertices) = mesh.uv;
    for (Eigen::Index v = 0; v < vertices; ++v) {
      std::array<float, kNumDefaultSegments> sums{};
      for (Eigen::Index k = 0; k < mesh.weights.rows(); ++k) {
        sums[character->bone_segment[mesh.bones(k, v)]] += std::max(0.0f, mesh.weights(k, v));
      }
      std::vector<Influence>& list = influences[first_vertex + v];
      for (int s = 0; s < kNumDefaultSegments; ++s) {
        if (sums[s] > 0) list.emplace_back(sums[s], s);
      }
      if (list.empty()) {
        const int bone = NearestBone(rig, mesh.mesh.positions.col(v).cast<double>());
        list.emplace_back(1.0f, character->bone_segment[bone]);
      }
      std::stable_sort(list.begin(), list.end(),
                       [](const Influence& a, const Influence& b) { return a.first > b.first; });
      num_influences = std::max(num_influences, list.size());
    }
    first_vertex += vertices;
    first_triangle += triangles;
  }
  character->segments.resize(static_cast<Eigen::Index>(num_influences), num_vertices);
  character->weights.setZero(static_cast<Eigen::Index>(num_influences), num_vertices);
  for (int v = 0; v < num_vertices; ++v) {
    character->segments.col(v).setConstant(influences[v].front().second);
    double sum = 0;
    for (const Influence& influence : influences[v]) sum += influence.first;
    for (size_t k = 0; k < influences[v].size(); ++k) {
      character->segments(k, v) = influences[v][k].second;
      character->weights(k, v) = static_cast<float>(influences[v][k].first / sum);
    }
  }
}

// Vertices that follow a segment more than any other, in the scene frame.
Eigen::Matrix3Xd SegmentVertices(const Character& character, int segment) {
  std::vector<int> indices;
  for (Eigen::Index v = 0; v < character.segments.cols(); ++v) {
    if (character.segments(0, v) == segment) indices.push_back(static_cast<int>(v));
  }
  return character.mesh.positions(Eigen::all, indices).cast<double>();
}

BindFrames FindFrames(const BindJoints& j, const Character& character) {
  BindFrames frames;
  auto& rotations = frames.rotations;
  auto& origins = frames.origins;
  rotations[kPelvisSegment] = UprightFrame(j.upper_leg[0] - j.upper_leg[1], j.up);
  rotations[kChestSegment] = UprightFrame(j.upper_arm[0] - j.upper_arm[1], j.up);
  // Nothing in a rig tells a tilted head from a straight one: at bind it is straight.
  rotations[kNeckSegment] = rotations[kHeadSegment] = rotations[kChestSegment];
  origins[kPelvisSegment] = j.hips;
  origins[kChestSegment] = j.spine;
  origins[kNeckSegment] = j.neck;
  origins[kHeadSegment] = j.head;
  for (int side = 0; side < 2; ++side) {
    const double mirror = side == 0 ? 1 : -1;
    const auto at = [side](DefaultSegment left) { return OnSide(left, side); };
    const auto hinge_axis = [&](DefaultSegment left) -> Vector3d {
      return std::find_if(character.skeleton.hinges.begin(), character.skeleton.hinges.end(),
                          [&](const Hinge& hinge) { return hinge.segment == at(left); })
          ->axis;
    };
    origins[at(kLeftUpperArmSegment)] = j.upper_arm[side];
    origins[at(kLeftForearmSegment)] = j.lower_arm[side];
    AimLimb(rotations[kChestSegment], mirror * Vector3d::UnitX(), hinge_axis(kLeftForearmSegment),
            j.upper_arm[side], j.lower_arm[side], j.hand[side],
            &rotations[at(kLeftUpperArmSegment)], &rotations[at(kLeftForearmSegment)]);
    origins[at(kLeftThighSegment)] = j.upper_leg[side];
    origins[at(kLeftShankSegment)] = j.lower_leg[side];
    AimLimb(rotations[kPelvisSegment], -Vector3d::UnitY(), hinge_axis(kLeftShankSegment),
            j.upper_leg[side], j.lower_leg[side], j.foot[side], &rotations[at(kLeftThighSegment)],
            &rotations[at(kLeftShankSegment)]);
    origins[at(kLeftFootSegment)] = j.foot[side];
    rotations[at(kLeftFootSegment)] = FootFrame(j, side, rotations[kPelvisSegment],
                                                SegmentVertices(character, at(kLeftFootSegment)));
  }
  return frames;
}

// Offsets, rest rotations and the bind pose that put the segments at their bind frames.
void FitSegments(const BindFrames& frames, Skeleton* skeleton, Eigen::VectorXd* pose) {
  *pose = ZeroPose(*skeleton);
  pose->head<3>() = frames.origins[0];
  pose->segment<3>(3) = LogSO3(frames.rotations[0]);
  size_t h = 0;
  for (int s = 1; s < kNumDefaultSegments; ++s) {
    Segment& segment = skeleton->segments[s];
    const Matrix3d scene_from_parent = frames.rotations[segment.parent];
    const Matrix3d parent_from_segment = scene_from_parent.transpose() * frames.rotations[s];
    segment.offset =
        scene_from_parent.transpose() * (frames.origins[s] - frames.origins[segment.parent]);
    const size_t begin = h;
    while (h < skeleton->hinges.size() && skeleton->hinges[h].segment == s) ++h;
    if (h - begin == 3) {
      pose->segment<3>(6 + begin) = ThreeHingeAngles(parent_from_segment, &skeleton->hinges[begin]);
    } else {
      // Of two hinges the second (eversion of a foot) is at rest at bind.
      (*pose)[6 + begin] = NearestAngle(parent_from_segment, skeleton->hinges[begin].axis);
      segment.rest_rotation =
          parent_from_segment *
          AngleAxisd(-(*pose)[6 + begin], skeleton->hinges[begin].axis).toRotationMatrix();
    }
  }
}

void SetJoint(Skeleton* skeleton, JointId id, const Vector3d& x_in_segment) {
  skeleton->joints[skeleton->FindJointIndex(id)].x_in_segment = x_in_segment;
}

// Joints that are points of segments: from bones where there are, else from the mesh.
void FitJoints(const BindJoints& j, const BindFrames& frames, Character* character) {
  Skeleton* skeleton = &character->skeleton;
  const auto in_segment = [&](int segment, const Vector3d& x) -> Vector3d {
    return frames.rotations[segment].transpose() * (x - frames.origins[segment]);
  };
  const auto vertices_in_segment = [&](int segment) -> Eigen::Matrix3Xd {
    return frames.rotations[segment].transpose() *
           (SegmentVertices(*character, segment).colwise() - frames.origins[segment]);
  };
  SetJoint(skeleton, JointId::kNeck, in_segment(kChestSegment, j.neck));
  SetJoint(skeleton, JointId::kLeftWrist, in_segment(kLeftForearmSegment, j.hand[0]));
  SetJoint(skeleton, JointId::kRightWrist, in_segment(kRightForearmSegment, j.hand[1]));

  const HeadLandmarks head = FindHeadLandmarks(vertices_in_segment(kHeadSegment));
  if (head.top) SetJoint(skeleton, JointId::kHeadTop, *head.top);
  if (head.face) {
    SetJoint(skeleton, JointId::kNose, head.face->nose);
    SetJoint(skeleton, JointId::kLeftEye, head.face->left_eye);
    SetJoint(skeleton, JointId::kRightEye, head.face->right_eye);
    SetJoint(skeleton, JointId::kLeftEar, head.face->left_ear);
    SetJoint(skeleton, JointId::kRightEar, head.face->right_ear);
  }
  for (int side = 0; side < 2; ++side) {
    const auto id = [side](JointId left) { return side == 0 ? left : MirrorJoint(left); };
    const int segment = OnSide(kLeftFootSegment, side);
    const double inner_x = side == 0 ? -1 : 1;
    const auto foot = FindFootLandmarks(vertices_in_segment(segment), inner_x);
    if (foot) {
      SetJoint(skeleton, id(JointId::kLeftToe), foot->big_toe);
      SetJoint(skeleton, id(JointId::kLeftSmallToe), foot->small_toe);
      SetJoint(skeleton, id(JointId::kLeftHeel), foot->heel);
    }
  }
}

}  // namespace

Character BuildCharacter(const RigAsset& rig, const RigMap& map) {
  rig.Validate();
  for (int p = 0; p < kNumRigParts; ++p) {
    if (map.bone[p] < -1 || map.bone[p] >= static_cast<int>(rig.bones.size())) {
      throw Error(ErrorCode::kMismatch,
                  fmt::format("{}: the rig map's {} is bone {} of {}", rig.source,
                              RigPartName(static_cast<RigPart>(p)), map.bone[p], rig.bones.size()));
    }
    if (map.bone[p] < 0 && IsRequired(static_cast<RigPart>(p))) {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{}: the rig map has no bone for {}", rig.source,
                              RigPartName(static_cast<RigPart>(p))));
    }
  }
  const BindJoints joints = FindJoints(rig, map);
  Character character;
  character.skeleton = DefaultSkeleton(joints.height);
  character.bone_segment = BoneSegments(rig, map, joints);
  BuildMesh(rig, &character);
  const BindFrames frames = FindFrames(joints, character);
  FitSegments(frames, &character.skeleton, &character.bind_pose);
  FitJoints(joints, frames, &character);
  ForwardKinematics(character.skeleton, character.bind_pose, &character.bind);
  return character;
}

}  // namespace mpc
