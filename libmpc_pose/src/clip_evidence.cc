#include "mpc/pose/clip_evidence.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string_view>
#include <utility>

#include "anchored_joints.h"
#include "mpc/core/units.h"
#include "mpc/pose/detection_repair.h"
#include "mpc/skeleton/world.h"
#include "translation_fit.h"

namespace mpc {
namespace {

using enum JointId;

// From the median length of the error to its root mean square.
constexpr double kErrorSpread = 1.3;
constexpr double kErrorStandingMm = 15;    // of a standing foot along the ray
constexpr double kRobustStandingMm = 200;  // it does not stand there after all
constexpr double kUsualError2dMm = 7;      // of the best networks, per axis
constexpr double kMinError2dMm = 2;
// Part of the errors is followed by the solution that they are measured from.
constexpr double kFollowed = 1.35;
// Errors that last are followed for the most part: they are at most so many times what is left of them.
constexpr double kFollowedLasting = 12;
constexpr double kMinFpsForWhite = 15;  // below it lasting errors change from frame to frame too
constexpr double kMinError3dMm = 20;
constexpr double kMaxError3dMm = 100;
constexpr double kLastingError3dMm = 60;  // from here on they are discounted wholly
constexpr double kAllOrNothing = 0.1;     // shares of white errors this near to 0 or 1 are that
constexpr double kWhiteRestDiscount = 0.94;
constexpr int kErrorFrames = 60;  // frames the 3D detections' error is measured on
constexpr double kNoPck = 1e3;    // PCK of a frame that cannot be compared

// Parents first. The torso is spanned by joints that detectors and rigs define alike.
constexpr std::array<JointPair, 23> kBones = {{
    {kPelvis, kLeftHip},
    {kPelvis, kRightHip},
    {kPelvis, kNeck},
    {kPelvis, kLeftShoulder},
    {kPelvis, kRightShoulder},
    {kLeftShoulder, kRightShoulder},
    {kLeftHip, kRightHip},
    {kNeck, kHeadTop},
    {kNeck, kNose},
    {kLeftShoulder, kLeftElbow},
    {kLeftElbow, kLeftWrist},
    {kRightShoulder, kRightElbow},
    {kRightElbow, kRightWrist},
    {kLeftHip, kLeftKnee},
    {kLeftKnee, kLeftAnkle},
    {kLeftAnkle, kLeftToe},
    {kLeftAnkle, kLeftHeel},
    {kLeftAnkle, kLeftSmallToe},
    {kRightHip, kRightKnee},
    {kRightKnee, kRightAnkle},
    {kRightAnkle, kRightToe},
    {kRightAnkle, kRightHeel},
    {kRightAnkle, kRightSmallToe},
}};

// Trust in a joint's 2D detection relative to a wrist: face points move with hair and hats and
// their place on the mesh is a guess; hips, neck and pelvis are defined differently by everyone.
double JointTrust(JointId id) {
  switch (id) {
    case kHeadTop:
    case kNose:
    case kLeftEye:
    case kRightEye:
    case kLeftEar:
    case kRightEar:
      return 0.1;
    case kNeck:
    case kPelvis:
      return 0.25;
    case kLeftHip:
    case kRightHip:
    case kLeftSmallToe:
    case kRightSmallToe:
      return 0.5;
    default:
      return 1;
  }
}

// The distance of two joints never changes: one of them lies in, or at the origin of, the segment
// of the other.
bool IsRigid(const Skeleton& skeleton, int a, int b) {
  const auto carrier = [&](int joint) {
    const int segment = skeleton.joints[joint].segment;
    const bool at_origin = skeleton.joints[joint].x_in_segment.isZero();
    return at_origin && segment > 0 ? skeleton.segments[segment].parent : segment;
  };
  const int segment_a = skeleton.joints[a].segment;
  const int segment_b = skeleton.joints[b].segment;
  return segment_a == segment_b || carrier(a) == segment_b || segment_a == carrier(b) ||
         carrier(a) == carrier(b);
}

// How people hold a joint: the relaxed angle and the usual spread around it (degrees). Trunk, neck
// and twists stay near rest, limbs swing; rough values, since the prior is weak.
struct Posture {
  std::string_view suffix;  // of the hinge's name
  double rest_deg;
  double spread_deg;
};
constexpr std::array<Posture, 17> kPostures = {{
    {"spine_flexion", 5, 20},
    {"spine_lateral", 0, 12},
    {"spine_twist", 0, 15},
    {"neck_flexion", 0, 20},
    {"neck_lateral", 0, 15},
    {"neck_twist", 0, 25},
    {"head_nod", 0, 10},
    {"shoulder_abduction", -70, 50},
    {"shoulder_flexion", 5, 45},
    {"shoulder_twist", 0, 40},
    {"elbow_flexion", 15, 45},
    {"hip_flexion", 5, 90},
    {"hip_abduction", 3, 15},
    {"hip_twist", 3, 15},
    {"knee_flexion", 8, 70},
    {"ankle_flexion", 0, 15},
    {"ankle_eversion", 0, 12},
}};

Posture FindPosture(std::string_view hinge_name) {
  for (const Posture& posture : kPostures) {
    if (hinge_name.ends_with(posture.suffix)) return posture;
  }
  return {"", 0, 30};
}

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// Joint positions of the rescaled detection, chained along the bones from the first one seen.
struct ChainedJoints {
  std::vector<int> joints;  // indices into Skeleton::joints
  Eigen::Matrix3Xd positions;
};

ChainedJoints ChainJoints(int num_joints, const std::vector<EvidenceBone>& bones,
                          const FrameObservation& observation) {
  ChainedJoints chained;
  std::vector<Eigen::Vector3d> position(num_joints, Eigen::Vector3d::Zero());
  std::vector<bool> known(num_joints, false);
  const auto add = [&](int joint, const Eigen::Vector3d& x) {
    position[joint] = x;
    known[joint] = true;
    chained.joints.push_back(joint);
  };
  for (bool grown = !observation.bone.empty(); grown;) {
    grown = false;
    if (chained.joints.empty()) add(bones[observation.bone[0]].a, Eigen::Vector3d::Zero());
    for (size_t i = 0; i < observation.bone.size(); ++i) {
      const EvidenceBone& bone = bones[observation.bone[i]];
      if (known[bone.a] == known[bone.b]) continue;
      if (known[bone.a]) {
        add(bone.b, position[bone.a] + observation.bone_vector[i]);
      } else {
        add(bone.a, position[bone.b] - observation.bone_vector[i]);
      }
      grown = true;
    }
  }
  chained.positions.resize(3, chained.joints.size());
  for (size_t i = 0; i < chained.joints.size(); ++i) {
    chained.positions.col(i) = position[chained.joints[i]];
  }
  return chained;
}

}  // namespace

ClipEvidence::ClipEvidence(const Skeleton& skeleton, const Camera& camera,
                           const Detections2d& detections2d, const Detections3d* detections3d,
                           double fps, const PoseOptions& options,
                           std::span<const CameraFromWorld> camera_motion)
    : camera_(camera),
      base_from_camera_(BaseFromCamera(camera, camera_motion, std::ssize(detections2d.frames))),
      has_world_(camera.has_extrinsics),
      detections2d_(std::make_shared<Detections2d>(detections2d)),
      fps_(fps),
      options_(options),
      error_2d_mm_(options.error_2d_mm > 0 ? options.error_2d_mm : kError2dMm),
      error_3d_mm_(options.error_3d_mm),
      depth_error_ratio_(options.depth_error_ratio) {
  if (detections3d != nullptr) detections3d_ = std::make_shared<Detections3d>(*detections3d);
  for (int id = 0; id < kNumJointIds; ++id) {
    column3d_[id] =
        detections3d == nullptr ? -1 : FindColumn(detections3d->joints, static_cast<JointId>(id));
  }
  SetSkeleton(skeleton);
  rest_spreads_.resize(static_cast<Eigen::Index>(skeleton_.hinges.size()));
  for (size_t h = 0; h < skeleton_.hinges.size(); ++h) {
    rest_spreads_[h] = FindPosture(skeleton_.hinges[h].name).spread_deg * kDegree;
  }
  rest_weights_ = options.weight_rest * kNoiseCost * rest_spreads_.array().square().inverse();
  // Errors are measured on what was detected, not on what repair made of it.
  if (detections3d != nullptr && options.error_3d_mm == 0) MeasureError3d();
  // A prior does not average out over frames as white errors do.
  rest_weights_ *= 1 - kWhiteRestDiscount * white_share_;
  if (!options.repair_detections) return;
  detections2d_ = std::make_shared<Detections2d>(RepairDetections(detections2d, fps));
  if (detections3d == nullptr) return;
  detections3d_ = std::make_shared<Detections3d>(RepairDetections(*detections3d, fps));
}

ClipEvidence ClipEvidence::ForSkeleton(const Skeleton& skeleton) const {
  ClipEvidence evidence = *this;
  evidence.SetSkeleton(skeleton);
  for (size_t i = 0; i < bones_.size(); ++i) {
    evidence.bones_[i].gain = bones_[i].gain * bones_[i].length / evidence.bones_[i].length;
  }
  return evidence;
}

void ClipEvidence::SetSkeleton(const Skeleton& skeleton) {
  skeleton_ = skeleton;
  for (int id = 0; id < kNumJointIds; ++id) {
    joint_index_[id] = skeleton_.FindJointIndex(static_cast<JointId>(id));
  }
  KinematicState rest;
  ForwardKinematics(skeleton_, ZeroPose(skeleton_), &rest);
  bones_.clear();
  for (const JointPair& pair : kBones) {
    const int a = joint_index_[static_cast<int>(pair.a)];
    const int b = joint_index_[static_cast<int>(pair.b)];
    if (a < 0 || b < 0) continue;
    bones_.push_back(
        {a, b, (rest.joints.col(b) - rest.joints.col(a)).norm(), IsRigid(skeleton_, a, b)});
  }
}

// Position of a detected 3D joint; the pelvis may come from the hips.
bool ClipEvidence::Position3d(int f, JointId id, SideSwap swap, Eigen::Vector3d* position,
                              double* confidence) const {
  const Detections3d::Frame& frame = detections3d_->frames[f];
  const bool mirrored = swap == SideSwap::k3d || swap == SideSwap::kBoth;
  const int column = column3d_[static_cast<int>(mirrored ? MirrorJoint(id) : id)];
  if (column >= 0 && frame.confidence[column] > 0) {
    *position = frame.positions.col(column);
    *confidence = frame.confidence[column];
    return true;
  }
  if (id != kPelvis) return false;
  Eigen::Vector3d left, right;
  double left_confidence = 0;
  double right_confidence = 0;
  if (!Position3d(f, kLeftHip, swap, &left, &left_confidence) ||
      !Position3d(f, kRightHip, swap, &right, &right_confidence)) {
    return false;
  }
  *position = 0.5 * (left + right);
  *confidence = std::min(left_confidence, right_confidence);
  return true;
}

FrameObservation ClipEvidence::Observe(int f, SideSwap swap, const Eigen::Vector3d* hips) const {
  FrameObservation observation;
  const Detections2d::Frame& frame = detections2d_->frames[f];
  const bool mirrored = swap == SideSwap::k2d || swap == SideSwap::kBoth;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double total = 0;
  for (size_t i = 0; i < detections2d_->joints.size(); ++i) {
    const JointId seen = detections2d_->joints[i];
    const JointId id = mirrored ? MirrorJoint(seen) : seen;
    const int joint = joint_index_[static_cast<int>(id)];
    const double confidence = frame.confidence[i];
    if (joint < 0 || confidence <= 0) continue;
    const double weight = options_.confidence_weights ? confidence * JointTrust(id) : 1;
    observation.points.push_back({joint, frame.pixels.col(i), weight, confidence});
    centre += weight * frame.pixels.col(i);
    total += weight;
  }
  if (hips != nullptr) {
    observation.camera_from_ray = CameraFromRay(*hips);
  } else if (total > 0) {
    observation.camera_from_ray = CameraFromRay(PixelRay(camera_, centre / total));
  }
  if (detections3d_ == nullptr) return observation;

  const Eigen::Matrix3d camera_from_detection =
      detections3d_->ray_aligned ? observation.camera_from_ray : Eigen::Matrix3d::Identity();
  double rigid_length = 0;
  double detected_length = 0;
  for (size_t i = 0; i < bones_.size(); ++i) {
    Eigen::Vector3d a, b;
    double confidence_a = 0;
    double confidence_b = 0;
    if (!Position3d(f, skeleton_.joints[bones_[i].a].id, swap, &a, &confidence_a) ||
        !Position3d(f, skeleton_.joints[bones_[i].b].id, swap, &b, &confidence_b)) {
      continue;
    }
    const Eigen::Vector3d vector = camera_from_detection * (b - a);
    const double length = vector.norm();
    if (length < 1e-6) continue;
    if (bones_[i].rigid) {
      rigid_length += bones_[i].length;
      detected_length += length;
    }
    observation.bone.push_back(static_cast<int>(i));
    observation.bone_vector.push_back(vector);
    observation.bone_confidence.push_back(
        options_.confidence_weights ? std::min(confidence_a, confidence_b) : 1);
  }
  if (rigid_length == 0) {
    observation.bone.clear();
    return observation;
  }
  for (int j = 0; j < skeleton_.num_joints(); ++j) {
    Eigen::Vector3d x;
    double confidence = 0;
    if (static_cast<int>(skeleton_.joints[j].id) >= kNumPaperJoints ||
        !Position3d(f, skeleton_.joints[j].id, swap, &x, &confidence)) {
      continue;
    }
    observation.joint_3d.push_back(j);
    observation.position_3d.push_back(camera_from_detection * x);
    observation.confidence_3d.push_back(options_.confidence_weights ? confidence : 1);
  }
  // Rigid bones take the actor's length, the others (across the spine or neck) the frame's scale.
  observation.scale_3d = rigid_length / detected_length;
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones_[observation.bone[i]];
    Eigen::Vector3d& vector = observation.bone_vector[i];
    vector *= bone.rigid ? bone.length / vector.norm() : observation.scale_3d;
  }
  MeasurePck(f, swap, camera_from_detection, &observation);
  // w_f: binary, from PCK_f.
  observation.use_3d = observation.pck < options_.pck_threshold;
  return observation;
}

FrameObservation ClipEvidence::Rescaled(FrameObservation observation) const {
  double before = 0;
  double after = 0;
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones_[observation.bone[i]];
    if (!bone.rigid) continue;
    before += observation.bone_vector[i].norm();
    after += bone.length;
  }
  if (before == 0) return observation;
  observation.scale_3d *= after / before;
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones_[observation.bone[i]];
    Eigen::Vector3d& vector = observation.bone_vector[i];
    vector *= bone.rigid ? bone.length / vector.norm() : after / before;
  }
  return observation;
}

// PCK_f: the 3D detection, scaled to the actor, is placed where it projects best onto the 2D points
// (t_f, linear least squares in normalised coordinates, reweighted against outliers); the error is
// taken over the joints both sources have, in torso lengths.
void ClipEvidence::MeasurePck(int f, SideSwap swap, const Eigen::Matrix3d& camera_from_detection,
                              FrameObservation* observation) const {
  struct Match {
    Eigen::Vector3d x;  // metres, any offset
    Eigen::Vector2d m;  // normalised image point
    Eigen::Vector2d pixel;
    JointId id;
    double weight;
  };
  std::vector<Match> matches;
  for (const Observation2d& point : observation->points) {
    const JointId id = skeleton_.joints[point.joint].id;
    Eigen::Vector3d x;
    double confidence = 0;
    if (!Position3d(f, id, swap, &x, &confidence)) continue;
    matches.push_back({observation->scale_3d * (camera_from_detection * x),
                       Undistort(camera_, point.pixel), point.pixel, id, point.weight});
  }
  if (matches.size() < 4) return;
  double torso_px = 0;
  double extent = 0;
  const auto pixel_of = [&](JointId id) -> const Eigen::Vector2d* {
    for (const Match& match : matches) {
      if (match.id == id) return &match.pixel;
    }
    return nullptr;
  };
  for (const JointPair& side :
       {JointPair{kLeftShoulder, kLeftHip}, JointPair{kRightShoulder, kRightHip}}) {
    const Eigen::Vector2d* shoulder = pixel_of(side.a);
    const Eigen::Vector2d* hip = pixel_of(side.b);
    if (shoulder != nullptr && hip != nullptr) {
      torso_px = std::max(torso_px, (*shoulder - *hip).norm());
    }
  }
  for (const Match& match : matches) {
    extent = std::max(extent, (match.pixel - matches[0].pixel).norm());
  }
  // A torso seen end-on projects short: never divide by less than a quarter of the whole extent.
  torso_px = std::max(torso_px, 0.25 * extent);
  if (torso_px <= 0) return;

  const bool robust = options_.robust_2d > 0;
  std::vector<double> trust(matches.size(), 1);
  std::vector<double> errors(matches.size());
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (int round = 0; round < (robust ? 4 : 1); ++round) {
    TranslationFit fit;
    for (size_t i = 0; i < matches.size(); ++i) {
      fit.Add(matches[i].x, matches[i].m, trust[i] * matches[i].weight);
    }
    translation = fit.Solve();
    if (!translation.allFinite()) return;
    for (size_t i = 0; i < matches.size(); ++i) {
      Eigen::Vector2d pixel;
      const bool visible = Project(camera_, matches[i].x + translation, &pixel);
      errors[i] = visible ? (pixel - matches[i].pixel).norm() : kNoPck * torso_px;
      const double relative = errors[i] / (options_.pck_threshold * torso_px);
      trust[i] = 1 / (1 + relative * relative);
    }
  }
  // A few outliers must not switch a frame's 3D off: the median in place of the mean.
  const double error_px = robust ? Median(&errors)
                                 : std::accumulate(errors.begin(), errors.end(), 0.0) /
                                       static_cast<double>(errors.size());
  observation->pck = error_px / torso_px;
  observation->mm_per_px = 1000 * translation.z() * 2 / (camera_.fx + camera_.fy);
  observation->error_mm = error_px * observation->mm_per_px;
}

// How the 3D detections of this clip err. Across the ray: the median distance from the 2D. Errors
// that last for seconds (a network's) do not average out over frames, and along the ray nothing
// measures them: options.depth_error_ratio. Errors that change from frame to frame show in second
// differences, beyond those of the 2D detections, along the ray too; so far as the error is of that
// kind its measured ratio counts.
void ClipEvidence::MeasureError3d() {
  std::vector<double> errors;
  std::vector<double> across2;  // squared second differences of joints, mm^2
  std::vector<double> along2;
  std::vector<double> pixels2;
  const int step = std::max(1, num_frames() / kErrorFrames);
  for (int f = 0; f < num_frames(); f += step) {
    const FrameObservation observation = Observe(f);
    if (!observation.use_3d) continue;
    errors.push_back(observation.error_mm);
    if (f == 0 || f + 1 == num_frames()) continue;
    for (size_t i = 0; i < detections2d_->joints.size(); ++i) {
      const int column = column3d_[static_cast<int>(detections2d_->joints[i])];
      if (column < 0) continue;
      bool seen = true;
      for (const int g : {f - 1, f, f + 1}) {
        seen = seen && detections2d_->frames[g].confidence[i] > 0 &&
               detections3d_->frames[g].confidence[column] > 0;
      }
      if (!seen) continue;
      const auto x = [&](int g) { return detections3d_->frames[g].positions.col(column); };
      const auto u = [&](int g) { return detections2d_->frames[g].pixels.col(i); };
      const Eigen::Vector3d bend = 1000 * observation.scale_3d * (x(f - 1) - 2 * x(f) + x(f + 1));
      const Eigen::Vector2d bend_2d = observation.mm_per_px * (u(f - 1) - 2 * u(f) + u(f + 1));
      across2.push_back(bend.head<2>().squaredNorm());
      along2.push_back(bend.z() * bend.z());
      pixels2.push_back(bend_2d.squaredNorm());
    }
  }
  error_3d_mm_ = kMaxError3dMm;
  depth_error_ratio_ = options_.depth_error_ratio;
  if (errors.empty()) return;
  const double error_mm = Median(&errors);
  // The distance holds the 2D detection's error too, which is at least this on each axis.
  const double distance_mm = kErrorSpread * error_mm;
  const double error2 = distance_mm * distance_mm - 2 * kUsualError2dMm * kUsualError2dMm;
  error_3d_mm_ = std::clamp(std::sqrt(std::max(0.0, error2)), kMinError3dMm, kMaxError3dMm);
  if (across2.empty()) return;
  // Medians of |x|^2 for unit normals: 1.386 in two dimensions, 0.455 in one; a second difference of
  // white noise has six times its variance.
  const double motion2 = Median(&pixels2) / 1.386 / 6;
  const double white_across2 = std::max(0.0, Median(&across2) / 1.386 / 6 - motion2);
  const double white_along2 = std::max(0.0, Median(&along2) / 0.455 / 6 - motion2);
  const double share = std::min(1.0, 1.386 * white_across2 / std::max(1.0, error_mm * error_mm));
  const double white_ratio = std::sqrt(white_along2 / std::max(1e-6, white_across2));
  depth_error_ratio_ = (1 - share) * options_.depth_error_ratio +
                       share * std::clamp(white_ratio, 0.5, options_.depth_error_ratio);
  white_share_ = share < kAllOrNothing ? 0 : share > 1 - kAllOrNothing ? 1 : share;
  error_white_mm_ = std::clamp(std::sqrt(white_across2), kMinError3dMm, kMaxError3dMm);
}

void ClipEvidence::TrustError2d() {
  if (fps_ >= kMinFpsForWhite) error_2d_mm_ = kUsualError2dMm;
}

// White errors stay in the residuals nearly as they are. Errors that last (joints that are defined
// differently) are fitted away for the most part and leave residuals that last too: those say no more
// than how large the errors may be.
void ClipEvidence::MeasureError2d(const std::vector<FrameObservation>& observations,
                                  const Eigen::MatrixXd& poses) {
  if (fps_ < kMinFpsForWhite) return;
  std::vector<double> lengths2;  // squared residuals, mm^2
  std::vector<double> changes2;  // of their changes from frame to frame
  KinematicState state;
  const Eigen::Matrix2Xd unseen = Eigen::Matrix2Xd::Constant(
      2, skeleton_.num_joints(), std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix2Xd before = unseen;
  for (int f = 0; f < num_frames(); ++f) {
    Eigen::Matrix2Xd residuals = unseen;
    ForwardKinematics(skeleton_, poses.col(f), &state);
    const double mm_per_px = 2000 * poses(2, f) / (camera_.fx + camera_.fy);
    for (const Observation2d& point : observations[f].points) {
      Eigen::Vector2d pixel;
      if (JointTrust(skeleton_.joints[point.joint].id) < 1 ||
          !Project(camera_, state.joints.col(point.joint), &pixel)) {
        continue;
      }
      residuals.col(point.joint) = mm_per_px * (pixel - point.pixel);
      lengths2.push_back(residuals.col(point.joint).squaredNorm());
      const double change2 = (residuals - before).col(point.joint).squaredNorm();
      if (std::isfinite(change2)) changes2.push_back(change2);
    }
    before = residuals;
  }
  error_2d_mm_ = kError2dMm;
  if (changes2.empty()) return;
  const double length2 = Median(&lengths2);
  const double residual_mm = std::sqrt(length2 / 1.386);  // median of |x|^2 for two unit normals
  // White residuals change by twice their variance. What is less than half white counts as lasting.
  const double white = std::clamp(Median(&changes2) / std::max(1e-6, length2) - 1, 0.0, 1.0);
  const double lasting_mm = std::min(kError2dMm, kFollowedLasting * residual_mm);
  error_2d_mm_ = std::clamp(white * kFollowed * residual_mm + (1 - white) * lasting_mm,
                            kMinError2dMm, kError2dMm);
}

// What errs for seconds errs alike in all their frames, while errors of the 2D detections average out:
// what is left of the weight is for which way limbs point, and that is settled.
void ClipEvidence::DiscountLasting() {
  if (detections3d_ == nullptr) return;
  const double share =
      std::clamp((error_3d_mm_ - kMinError3dMm) / (kLastingError3dMm - kMinError3dMm), 0.0, 1.0);
  const double error_gain = 1 + share * (options_.lasting_discount - 1);
  lasting_weight_ = 1 / (error_gain * error_gain);
  rest_weights_ /= options_.lasting_discount;
}

FrameProblem ClipEvidence::MakeProblem(const FrameObservation& observation, double depth_m,
                                       double loss_width, const Eigen::VectorXd& rest,
                                       const Eigen::Matrix3Xd* joints) const {
  FrameProblem problem;
  // The sums of E_2d and E_3d are means over the paper's joints.
  const double mean = 1.0 / kNumPaperJoints;
  const double unit_per_px = options_.pixels_in_mm
                                 ? 1000 * depth_m * 2 / (camera_.fx + camera_.fy)
                                 : 1920.0 / std::max(camera_.width, camera_.height);
  std::vector<Observation2d> points = observation.points;
  const double gain_2d = kError2dMm / error_2d_mm_;
  for (Observation2d& point : points) point.weight *= mean * gain_2d * gain_2d;
  problem.reprojection =
      ReprojectionEnergy(camera_, std::move(points), unit_per_px, loss_width * options_.robust_2d);

  if (observation.use_3d && options_.anisotropic_3d) {
    const Eigen::Matrix3d& rotation = observation.camera_from_ray;
    std::vector<BoneObservation> vectors;
    vectors.reserve(observation.bone.size());
    const int pelvis = joint_index_[static_cast<int>(kPelvis)];
    const double white_share = joints != nullptr && pelvis >= 0 ? white_share_ : 0;
    for (size_t i = 0; white_share < 1 && i < observation.bone.size(); ++i) {
      const EvidenceBone& bone = bones_[observation.bone[i]];
      vectors.push_back({bone.a, bone.b, observation.bone_vector[i],
                         lasting_weight_ * (1 - white_share) * mean * bone.gain * bone.gain *
                             observation.bone_confidence[i]});
    }
    BoneVectorWeights weights;
    weights.across = kError2dMm / error_3d_mm_;
    weights.along = weights.across / depth_error_ratio_;
    if (joints != nullptr && white_share > 0) {
      const double gain = error_3d_mm_ / error_white_mm_;
      for (BoneObservation joint :
           AnchorJoints(observation, *joints, pelvis, error_white_mm_ / 1000)) {
        joint.weight *= white_share * mean * gain * gain;
        vectors.push_back(joint);
      }
    }
    weights.robust_scale = loss_width * options_.robust_3d;
    problem.bone_vectors = BoneVectorEnergy(std::move(vectors), rotation, weights);
  } else if (observation.use_3d) {
    const ChainedJoints chained = ChainJoints(skeleton_.num_joints(), bones_, observation);
    problem.joint_positions =
        JointPositionEnergy(chained.joints, chained.positions, options_.weight_3d * mean);
  }
  std::vector<StandingJoint> standing = observation.standing;
  standing.insert(standing.end(), observation.floor.begin(), observation.floor.end());
  const double gain_standing = kError2dMm / kErrorStandingMm;
  for (StandingJoint& joint : standing) joint.weight *= mean * gain_standing * gain_standing;
  problem.standing = StandingEnergy(std::move(standing), loss_width * kRobustStandingMm);
  if (options_.weight_rest > 0) {
    // Errors that average out need no prior to choose between limbs, and none that lets go of them.
    const double width = loss_width * options_.robust_rest / std::max(1e-9, 1 - white_share_);
    problem.rest_prior =
        RestPriorEnergy(rest.tail(rest_weights_.size()), rest_weights_,
                        width > 0 ? Eigen::VectorXd(width * rest_spreads_) : Eigen::VectorXd());
  }
  return problem;
}

Eigen::VectorXd RelaxedPose(const Skeleton& skeleton) {
  Eigen::VectorXd pose = ZeroPose(skeleton);
  for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
    const Hinge& hinge = skeleton.hinges[h];
    pose[6 + h] =
        std::clamp(FindPosture(hinge.name).rest_deg * kDegree, hinge.min_rad, hinge.max_rad);
  }
  return pose;
}

}  // namespace mpc
