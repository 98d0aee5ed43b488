#include "mpc/pose/observations.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace mpc {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct BoneSpec {
  JointId a;
  JointId b;
  int limb;
};
using enum JointId;
// Parents first. The torso is spanned by joints that detectors and rigs define alike.
constexpr std::array<BoneSpec, 23> kBones = {{
    {kPelvis, kLeftHip, -1},
    {kPelvis, kRightHip, -1},
    {kPelvis, kNeck, -1},
    {kPelvis, kLeftShoulder, -1},
    {kPelvis, kRightShoulder, -1},
    {kLeftShoulder, kRightShoulder, -1},
    {kLeftHip, kRightHip, -1},
    {kNeck, kHeadTop, -1},
    {kLeftShoulder, kLeftElbow, 0},
    {kLeftElbow, kLeftWrist, 0},
    {kRightShoulder, kRightElbow, 1},
    {kRightElbow, kRightWrist, 1},
    {kLeftHip, kLeftKnee, 2},
    {kLeftKnee, kLeftAnkle, 2},
    {kLeftAnkle, kLeftToe, 2},
    {kLeftAnkle, kLeftHeel, 2},
    {kLeftAnkle, kLeftSmallToe, 2},
    {kRightHip, kRightKnee, 3},
    {kRightKnee, kRightAnkle, 3},
    {kRightAnkle, kRightToe, 3},
    {kRightAnkle, kRightHeel, 3},
    {kRightAnkle, kRightSmallToe, 3},
    {kNeck, kNose, -1},
}};

// Trust in a joint's 2D detection relative to a wrist: face points move with hair and hats and
// their place on the mesh is a guess.
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

// Position of a detected 3D joint; the pelvis may come from the hips.
bool Detected3d(const Detections3d& detections, int f, JointId id, Eigen::Vector3d* position,
                double* confidence) {
  const Detections3d::Frame& frame = detections.frames[f];
  const int column = FindColumn(detections.joints, id);
  if (column >= 0 && frame.confidence[column] > 0) {
    *position = frame.positions.col(column);
    *confidence = frame.confidence[column];
    return true;
  }
  if (id != kPelvis) return false;
  const int left = FindColumn(detections.joints, kLeftHip);
  const int right = FindColumn(detections.joints, kRightHip);
  if (left < 0 || right < 0 || frame.confidence[left] <= 0 || frame.confidence[right] <= 0) {
    return false;
  }
  *position = 0.5 * (frame.positions.col(left) + frame.positions.col(right));
  *confidence = std::min(frame.confidence[left], frame.confidence[right]);
  return true;
}

// Joint positions of the rescaled detection relative to the pelvis, chained along the bones.
struct ChainedJoints {
  std::vector<int> joints;
  Eigen::Matrix3Xd positions;
};
ChainedJoints ChainJoints(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                          const FrameObservation& observation) {
  std::vector<int> order;
  std::vector<Eigen::Vector3d> position(skeleton.num_joints());
  std::vector<bool> known(skeleton.num_joints(), false);
  const auto set = [&](int joint, const Eigen::Vector3d& x) {
    position[joint] = x;
    known[joint] = true;
    order.push_back(joint);
  };
  const int pelvis = skeleton.FindJointIndex(kPelvis);
  if (pelvis >= 0) set(pelvis, Eigen::Vector3d::Zero());
  for (size_t i = 0; i < observation.bone.size(); ++i) {
    const EvidenceBone& bone = bones[observation.bone[i]];
    if (known[bone.a] && !known[bone.b]) {
      set(bone.b, position[bone.a] + observation.bone_vector[i]);
    }
  }
  ChainedJoints chained{order, Eigen::Matrix3Xd(3, order.size())};
  for (size_t i = 0; i < order.size(); ++i) chained.positions.col(i) = position[order[i]];
  return chained;
}

// t_f: where the detection must be so that it projects onto the 2D points (linear least squares in
// normalised coordinates); then PCK_f over the joints both sources have.
void FitTranslation(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                    const Camera& camera, FrameObservation* observation) {
  const ChainedJoints chained = ChainJoints(skeleton, bones, *observation);
  std::vector<std::pair<int, const Observation2d*>> matches;
  for (size_t i = 0; i < chained.joints.size(); ++i) {
    for (const Observation2d& point : observation->points) {
      if (point.joint == chained.joints[i]) matches.emplace_back(static_cast<int>(i), &point);
    }
  }
  if (matches.size() < 3) return;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const auto& [i, point] : matches) {
    const Eigen::Vector2d m = Undistort(camera, point->pixel);
    const Eigen::Vector3d x = chained.positions.col(i);
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

  const auto pixel_of = [&](JointId id) -> const Observation2d* {
    const int joint = skeleton.FindJointIndex(id);
    for (const Observation2d& point : observation->points) {
      if (point.joint == joint) return &point;
    }
    return nullptr;
  };
  double torso_px = 0;
  for (const auto& [shoulder, hip] :
       {std::pair{kLeftShoulder, kLeftHip}, std::pair{kRightShoulder, kRightHip}}) {
    const Observation2d* s = pixel_of(shoulder);
    const Observation2d* h = pixel_of(hip);
    if (s != nullptr && h != nullptr) {
      torso_px = std::max(torso_px, (s->pixel - h->pixel).norm());
    }
  }
  double error = 0;
  double weight = 0;
  double extent = 0;
  for (const auto& [i, point] : matches) {
    Eigen::Vector2d pixel;
    if (!Project(camera, chained.positions.col(i) + translation, &pixel)) continue;
    error += point->weight * (pixel - point->pixel).norm();
    weight += point->weight;
    extent = std::max(extent, (point->pixel - matches[0].second->pixel).norm());
  }
  // A torso seen end-on projects short: never divide by less than a quarter of the whole extent.
  torso_px = std::max(torso_px, 0.25 * extent);
  observation->pck = weight > 0 && torso_px > 0 ? error / weight / torso_px : 1;
}

}  // namespace

std::vector<EvidenceBone> EvidenceBones(const Skeleton& skeleton) {
  KinematicState rest;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &rest);
  std::vector<EvidenceBone> bones;
  for (const BoneSpec& spec : kBones) {
    const int a = skeleton.FindJointIndex(spec.a);
    const int b = skeleton.FindJointIndex(spec.b);
    if (a < 0 || b < 0) continue;
    const double length = (rest.joints.col(b) - rest.joints.col(a)).norm();
    bones.push_back({a, b, length, spec.limb});
  }
  return bones;
}

FrameObservation ObserveFrame(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                              const Camera& camera, const Detections2d* detections2d,
                              const Detections3d* detections3d, int f, const PoseOptions& options) {
  FrameObservation observation;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double total = 0;
  if (detections2d != nullptr) {
    const Detections2d::Frame& frame = detections2d->frames[f];
    for (size_t i = 0; i < detections2d->joints.size(); ++i) {
      const int joint = skeleton.FindJointIndex(detections2d->joints[i]);
      const double confidence = frame.confidence[i];
      if (joint < 0 || confidence <= 0) continue;
      const double weight =
          options.confidence_weights ? confidence * JointTrust(detections2d->joints[i]) : 1;
      observation.points.push_back({joint, frame.pixels.col(i), weight});
      centre += weight * frame.pixels.col(i);
      total += weight;
    }
  }
  if (total > 0) observation.camera_from_ray = CameraFromRay(PixelRay(camera, centre / total));
  if (detections3d == nullptr) return observation;

  const Eigen::Matrix3d camera_from_detection =
      detections3d->ray_aligned ? observation.camera_from_ray : Eigen::Matrix3d::Identity();
  for (size_t i = 0; i < bones.size(); ++i) {
    Eigen::Vector3d a, b;
    double confidence_a = 0;
    double confidence_b = 0;
    if (!Detected3d(*detections3d, f, skeleton.joints[bones[i].a].id, &a, &confidence_a) ||
        !Detected3d(*detections3d, f, skeleton.joints[bones[i].b].id, &b, &confidence_b)) {
      continue;
    }
    const Eigen::Vector3d vector = camera_from_detection * (b - a);
    const double length = vector.norm();
    if (length < 1e-6) continue;
    observation.bone.push_back(static_cast<int>(i));
    observation.bone_vector.push_back(vector * (bones[i].length / length));
    observation.bone_confidence.push_back(std::min(confidence_a, confidence_b));
  }
  FitTranslation(skeleton, bones, camera, &observation);
  // w_f: binary, from PCK_f.
  observation.use_3d = observation.has_translation && observation.pck < options.pck_threshold;
  return observation;
}

FrameProblem MakeFrameProblem(const Skeleton& skeleton, const std::vector<EvidenceBone>& bones,
                              const Camera& camera, const FrameObservation& observation,
                              double depth_m, const std::vector<bool>& flipped,
                              const PoseOptions& options) {
  FrameProblem problem;
  // The sums of E_2d and E_3d are means over the paper's joints.
  const double mean = 1.0 / kNumPaperJoints;
  const double unit_per_px = options.pixels_in_mm ? 1000 * depth_m * 2 / (camera.fx + camera.fy)
                                                  : 1920.0 / std::max(camera.width, camera.height);
  std::vector<Observation2d> points = observation.points;
  for (Observation2d& point : points) point.weight *= mean;
  problem.reprojection =
      ReprojectionEnergy(camera, std::move(points), unit_per_px, options.robust_2d);

  if (observation.use_3d && options.anisotropic_3d) {
    const Eigen::Matrix3d& rotation = observation.camera_from_ray;
    std::vector<BoneObservation> vectors;
    for (size_t i = 0; i < observation.bone.size(); ++i) {
      const EvidenceBone& bone = bones[observation.bone[i]];
      Eigen::Vector3d vector = observation.bone_vector[i];
      if (!flipped.empty() && flipped[observation.bone[i]]) {
        vector -= 2 * rotation.col(2).dot(vector) * rotation.col(2);
      }
      vectors.push_back({bone.a, bone.b, vector, mean * observation.bone_confidence[i]});
    }
    BoneVectorWeights weights;
    weights.across = std::sqrt(options.weight_3d_across);
    weights.along = std::sqrt(options.weight_3d_along);
    weights.robust_scale = options.robust_3d;
    problem.bone_vectors = BoneVectorEnergy(std::move(vectors), rotation, weights);
  } else if (observation.use_3d) {
    const ChainedJoints chained = ChainJoints(skeleton, bones, observation);
    problem.joint_positions =
        JointPositionEnergy(chained.joints, chained.positions, options.weight_3d * mean);
  }
  if (options.weight_rest > 0) {
    const Eigen::VectorXd rest = RelaxedPose(skeleton).tail(skeleton.hinges.size());
    problem.rest_prior =
        RestPriorEnergy(rest, Eigen::VectorXd::Constant(rest.size(), options.weight_rest));
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
