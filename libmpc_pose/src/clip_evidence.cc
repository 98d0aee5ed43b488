#include "mpc/pose/clip_evidence.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

namespace mpc {
namespace {

using enum JointId;

constexpr double kDegree = std::numbers::pi / 180;

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

// Joint positions of the rescaled detection relative to the pelvis, chained along the bones.
struct ChainedJoints {
  std::vector<int> joints;  // indices into Skeleton::joints
  Eigen::Matrix3Xd positions;
};

ChainedJoints ChainJoints(int num_joints, int pelvis, const std::vector<EvidenceBone>& bones,
                          const FrameObservation& observation) {
  ChainedJoints chained;
  std::vector<Eigen::Vector3d> position(num_joints);
  std::vector<bool> known(num_joints, false);
  if (pelvis >= 0) {
    position[pelvis].setZero();
    known[pelvis] = true;
    chained.joints.push_back(pelvis);
  }
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones[observation.bone[i]];
    if (!known[bone.a] || known[bone.b]) continue;
    position[bone.b] = position[bone.a] + observation.bone_vector[i];
    known[bone.b] = true;
    chained.joints.push_back(bone.b);
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
                           const PoseOptions& options)
    : skeleton_(skeleton),
      camera_(camera),
      detections2d_(detections2d),
      detections3d_(detections3d),
      options_(options) {
  for (int id = 0; id < kNumJointIds; ++id) {
    joint_index_[id] = skeleton_.FindJointIndex(static_cast<JointId>(id));
    column3d_[id] =
        detections3d == nullptr ? -1 : FindColumn(detections3d->joints, static_cast<JointId>(id));
  }
  KinematicState rest;
  ForwardKinematics(skeleton_, ZeroPose(skeleton_), &rest);
  for (const JointPair& pair : kBones) {
    const int a = joint_index_[static_cast<int>(pair.a)];
    const int b = joint_index_[static_cast<int>(pair.b)];
    if (a < 0 || b < 0) continue;
    bones_.push_back({a, b, (rest.joints.col(b) - rest.joints.col(a)).norm()});
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

FrameObservation ClipEvidence::Observe(int f, SideSwap swap) const {
  FrameObservation observation;
  const Detections2d::Frame& frame = detections2d_.frames[f];
  const bool mirrored = swap == SideSwap::k2d || swap == SideSwap::kBoth;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double total = 0;
  for (size_t i = 0; i < detections2d_.joints.size(); ++i) {
    const JointId seen = detections2d_.joints[i];
    const JointId id = mirrored ? MirrorJoint(seen) : seen;
    const int joint = joint_index_[static_cast<int>(id)];
    const double confidence = frame.confidence[i];
    if (joint < 0 || confidence <= 0) continue;
    const double weight = options_.confidence_weights ? confidence * JointTrust(id) : 1;
    observation.points.push_back({joint, frame.pixels.col(i), weight, confidence});
    centre += weight * frame.pixels.col(i);
    total += weight;
  }
  if (total > 0) observation.camera_from_ray = CameraFromRay(PixelRay(camera_, centre / total));
  if (detections3d_ == nullptr) return observation;

  const Eigen::Matrix3d camera_from_detection =
      detections3d_->ray_aligned ? observation.camera_from_ray : Eigen::Matrix3d::Identity();
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
    observation.bone.push_back(static_cast<int>(i));
    observation.bone_vector.push_back(vector * (bones_[i].length / length));
    observation.bone_confidence.push_back(
        options_.confidence_weights ? std::min(confidence_a, confidence_b) : 1);
  }
  FitTranslation(&observation);
  // w_f: binary, from PCK_f.
  observation.use_3d = observation.has_translation && observation.pck < options_.pck_threshold;
  return observation;
}

// t_f: where the detection must be so that it projects onto the 2D points (linear least squares in
// normalised coordinates); then PCK_f over the joints both sources have.
void ClipEvidence::FitTranslation(FrameObservation* observation) const {
  const ChainedJoints chained = ChainJoints(
      skeleton_.num_joints(), joint_index_[static_cast<int>(kPelvis)], bones_, *observation);
  struct Match {
    Eigen::Vector3d x;
    const Observation2d* point;
  };
  std::vector<Match> matches;
  for (size_t i = 0; i < chained.joints.size(); ++i) {
    for (const Observation2d& point : observation->points) {
      if (point.joint == chained.joints[i]) matches.push_back({chained.positions.col(i), &point});
    }
  }
  if (matches.size() < 3) return;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const auto& [x, point] : matches) {
    const Eigen::Vector2d m = Undistort(camera_, point->pixel);
    for (int axis = 0; axis < 2; ++axis) {
      // (x_axis + t_axis) - m_axis (x_z + t_z) = 0
      Eigen::Vector3d row = Eigen::Vector3d::Unit(axis);
      row.z() = -m[axis];
      a += point->weight * row * row.transpose();
      b += point->weight * row * (m[axis] * x.z() - x[axis]);
    }
  }
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(a);
  const Eigen::Vector3d translation = ldlt.solve(b);
  if (ldlt.info() != Eigen::Success || !translation.allFinite() || translation.z() < 0.1) return;
  observation->translation = translation;
  observation->has_translation = true;

  const auto pixel_of = [&](JointId id) -> const Eigen::Vector2d* {
    for (const Observation2d& point : observation->points) {
      if (skeleton_.joints[point.joint].id == id) return &point.pixel;
    }
    return nullptr;
  };
  double torso_px = 0;
  for (const auto& [shoulder, hip] :
       {std::pair{kLeftShoulder, kLeftHip}, std::pair{kRightShoulder, kRightHip}}) {
    const Eigen::Vector2d* s = pixel_of(shoulder);
    const Eigen::Vector2d* h = pixel_of(hip);
    if (s != nullptr && h != nullptr) torso_px = std::max(torso_px, (*s - *h).norm());
  }
  double error = 0;
  double weight = 0;
  double extent = 0;
  for (const auto& [x, point] : matches) {
    Eigen::Vector2d pixel;
    if (!Project(camera_, x + translation, &pixel)) continue;
    error += point->weight * (pixel - point->pixel).norm();
    weight += point->weight;
    extent = std::max(extent, (point->pixel - matches[0].point->pixel).norm());
  }
  // A torso seen end-on projects short: never divide by less than a quarter of the whole extent.
  torso_px = std::max(torso_px, 0.25 * extent);
  observation->pck = weight > 0 && torso_px > 0 ? error / weight / torso_px : 1;
}

FrameProblem ClipEvidence::MakeProblem(const FrameObservation& observation, double depth_m,
                                       bool robust, const std::vector<bool>& flipped,
                                       const Eigen::VectorXd& rest) const {
  FrameProblem problem;
  // The sums of E_2d and E_3d are means over the paper's joints.
  const double mean = 1.0 / kNumPaperJoints;
  const double unit_per_px = options_.pixels_in_mm
                                 ? 1000 * depth_m * 2 / (camera_.fx + camera_.fy)
                                 : 1920.0 / std::max(camera_.width, camera_.height);
  std::vector<Observation2d> points = observation.points;
  for (Observation2d& point : points) point.weight *= mean;
  problem.reprojection =
      ReprojectionEnergy(camera_, std::move(points), unit_per_px, robust ? options_.robust_2d : 0);

  if (observation.use_3d && options_.anisotropic_3d) {
    const Eigen::Matrix3d& rotation = observation.camera_from_ray;
    std::vector<BoneObservation> vectors;
    vectors.reserve(observation.bone.size());
    for (size_t i = 0; i < observation.bone.size(); ++i) {
      const EvidenceBone& bone = bones_[observation.bone[i]];
      Eigen::Vector3d vector = observation.bone_vector[i];
      if (!flipped.empty() && flipped[observation.bone[i]]) {
        vector -= 2 * rotation.col(2).dot(vector) * rotation.col(2);
      }
      vectors.push_back({bone.a, bone.b, vector, mean * observation.bone_confidence[i]});
    }
    BoneVectorWeights weights;
    weights.across = std::sqrt(options_.weight_3d_across);
    weights.along = std::sqrt(options_.weight_3d_along);
    weights.robust_scale = robust ? options_.robust_3d : 0;
    problem.bone_vectors = BoneVectorEnergy(std::move(vectors), rotation, weights);
  } else if (observation.use_3d) {
    const ChainedJoints chained = ChainJoints(
        skeleton_.num_joints(), joint_index_[static_cast<int>(kPelvis)], bones_, observation);
    problem.joint_positions =
        JointPositionEnergy(chained.joints, chained.positions, options_.weight_3d * mean);
  }
  if (options_.weight_rest > 0) {
    const int num_hinges = static_cast<int>(skeleton_.hinges.size());
    problem.rest_prior = RestPriorEnergy(
        rest.tail(num_hinges), Eigen::VectorXd::Constant(num_hinges, options_.weight_rest));
  }
  return problem;
}

Eigen::VectorXd RelaxedPose(const Skeleton& skeleton) {
  struct Angle {
    std::string_view suffix;
    double degrees;
  };
  static constexpr std::array<Angle, 5> kAngles = {{{"shoulder_abduction", -70},
                                                    {"elbow_flexion", 15},
                                                    {"hip_flexion", 5},
                                                    {"knee_flexion", 8},
                                                    {"shoulder_flexion", 5}}};
  Eigen::VectorXd pose = ZeroPose(skeleton);
  for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
    const Hinge& hinge = skeleton.hinges[h];
    double angle = 0;
    for (const Angle& known : kAngles) {
      if (std::string_view(hinge.name).ends_with(known.suffix)) angle = known.degrees * kDegree;
    }
    pose[6 + h] = std::clamp(angle, hinge.min_rad, hinge.max_rad);
  }
  return pose;
}

}  // namespace mpc
