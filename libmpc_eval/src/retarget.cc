#include "mpc/eval/retarget.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <string_view>

#include "floor.h"
#include "mpc/core/error.h"
#include "mpc/core/joints.h"
#include "mpc/core/rigid.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

using enum JointId;

constexpr double kDegree = std::numbers::pi / 180;

// ------------------------------------------------------------------------ which joint is which

struct Alias {
  JointId joint;                          // the left one of a pair
  std::array<std::string_view, 6> names;  // best first; L stands for the side's spelling
};

// Lower case without separators. Order matters: Mixamo's "LeftShoulder" is a clavicle, so "LArm"
// is asked for first. {L} is replaced by "left"/"right" and by "l"/"r".
constexpr std::array<Alias, 8> kAliases = {{
    {kNeck, {"lowerneck", "neck", "neck1", "neck01", "", ""}},
    {kHeadTop, {"head", "headtop", "", "", "", ""}},
    {kLeftShoulder, {"{L}humerus", "{L}arm", "{L}upperarm", "{L}uparm", "{L}shoulder", ""}},
    {kLeftElbow, {"{L}radius", "{L}forearm", "{L}lowerarm", "{L}elbow", "", ""}},
    {kLeftWrist, {"{L}wrist", "{L}hand", "", "", "", ""}},
    {kLeftHip, {"{L}femur", "{L}upleg", "{L}upperleg", "{L}thigh", "{L}hip", ""}},
    {kLeftKnee, {"{L}tibia", "{L}leg", "{L}lowerleg", "{L}shin", "{L}calf", "{L}knee"}},
    {kLeftAnkle, {"{L}foot", "{L}ankle", "", "", "", ""}},
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

// Index in the source of each JointId of the 16, -1 for those that may be missing (toes, head top).
using JointMap = std::array<int, kNumPaperJoints>;

JointMap MapJoints(const SourceMotion& source) {
  std::vector<std::string> normalised;
  for (const std::string& name : source.names) normalised.push_back(Normalised(name));
  JointMap map;
  map.fill(-1);
  for (const Alias& alias : kAliases) {
    map[static_cast<size_t>(alias.joint)] = FindAlias(normalised, alias, false);
    const JointId mirror = MirrorJoint(alias.joint);
    if (mirror != alias.joint) {
      map[static_cast<size_t>(mirror)] = FindAlias(normalised, alias, true);
    }
  }
  std::vector<std::string_view> missing;
  for (int j = 0; j < kNumPaperJoints; ++j) {
    const auto id = static_cast<JointId>(j);
    const bool optional = id == kHeadTop || id == kLeftToe || id == kRightToe;
    if (map[j] < 0 && !optional) missing.push_back(JointName(id));
  }
  if (!missing.empty()) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("no joints recognised for {}; the motion's joints are {}",
                            fmt::join(missing, ", "), fmt::join(source.names, ", ")));
  }
  const auto index = [&](JointId id) -> int& { return map[static_cast<size_t>(id)]; };
  const auto tip = [&](JointId base) {
    const int end = FarEnd(source, index(base));
    return end == index(base) ? -1 : end;
  };
  index(kHeadTop) = index(kHeadTop) >= 0 ? FarEnd(source, index(kHeadTop)) : tip(kNeck);
  index(kLeftToe) = tip(kLeftAnkle);
  index(kRightToe) = tip(kRightAnkle);
  return map;
}

// ----------------------------------------------------------------------------- limb directions

// A direction from the middle of two points to the middle of two others.
struct Limb {
  std::array<JointId, 2> from;
  std::array<JointId, 2> to;
};

constexpr std::array<Limb, 14> kLimbs = {{
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
constexpr int kNumLimbs = static_cast<int>(kLimbs.size());
constexpr std::array<int, 2> kFootLimbs = {12, 13};

using LimbDirections = Eigen::Matrix<double, 3, kNumLimbs>;  // unit; zero where unknown

// Unit direction per limb of the source in one frame.
LimbDirections SourceDirections(const JointMap& map, const Eigen::Matrix3Xd& positions) {
  LimbDirections directions = LimbDirections::Zero();
  for (int l = 0; l < kNumLimbs; ++l) {
    std::array<int, 4> joints{};
    for (int i = 0; i < 2; ++i) {
      joints[i] = map[static_cast<size_t>(kLimbs[l].from[i])];
      joints[2 + i] = map[static_cast<size_t>(kLimbs[l].to[i])];
    }
    if (std::any_of(joints.begin(), joints.end(), [](int j) { return j < 0; })) continue;
    const Eigen::Vector3d vector = 0.5 * (positions.col(joints[2]) + positions.col(joints[3]) -
                                          positions.col(joints[0]) - positions.col(joints[1]));
    if (vector.norm() > 1e-9) directions.col(l) = vector.normalized();
  }
  return directions;
}

double PitchDown(const Eigen::Vector3d& direction) {
  return std::asin(std::clamp(-direction.y(), -1.0, 1.0));
}

// Where the ankle and the toe tip sit in a foot differs between skeletons: a flat foot's direction
// points down by another angle. Measures the source's angle as the median over the frames in which
// the ankle is low, and turns every foot direction, in the plane of foot and shank, by the
// difference to `flat_pitch`, our own angle.
void LevelFeet(const JointMap& map, const SourceMotion& source, double flat_pitch,
               std::vector<LimbDirections>* directions) {
  constexpr std::array<JointId, 2> ankles = {kLeftAnkle, kRightAnkle};
  for (int side = 0; side < 2; ++side) {
    const int foot = kFootLimbs[side];
    if (map[static_cast<size_t>(kLimbs[foot].to[0])] < 0) continue;
    const int ankle = map[static_cast<size_t>(ankles[side])];
    std::vector<std::pair<double, double>> height_and_pitch;
    for (size_t f = 0; f < directions->size(); ++f) {
      height_and_pitch.emplace_back(source.joint_positions[f](1, ankle),
                                    PitchDown((*directions)[f].col(foot)));
    }
    std::sort(height_and_pitch.begin(), height_and_pitch.end());
    height_and_pitch.resize(height_and_pitch.size() / 4 + 1);
    const auto middle = height_and_pitch.begin() + height_and_pitch.size() / 2;
    std::nth_element(height_and_pitch.begin(), middle, height_and_pitch.end(),
                     [](const auto& a, const auto& b) { return a.second < b.second; });
    const double pitch = std::clamp(middle->second, 0.0, 50 * kDegree);
    for (LimbDirections& frame : *directions) {
      const Eigen::Vector3d shank = frame.col(foot - 2);
      const Eigen::Vector3d axis = shank.cross(Eigen::Vector3d(frame.col(foot)));
      if (axis.norm() < 0.1) continue;
      frame.col(foot) = Eigen::AngleAxisd(pitch - flat_pitch, axis.normalized()) *
                        Eigen::Vector3d(frame.col(foot));
    }
  }
}

// ----------------------------------------------------------------------------- the fit per frame

// Joints of the skeleton by JointId; throws when one of the 16 is missing.
std::array<int, kNumPaperJoints> SkeletonJoints(const Skeleton& skeleton) {
  std::array<int, kNumPaperJoints> joints{};
  for (int j = 0; j < kNumPaperJoints; ++j) {
    joints[j] = skeleton.FindJointIndex(static_cast<JointId>(j));
    if (joints[j] < 0) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("the skeleton has no joint {}", JointName(static_cast<JointId>(j))));
    }
  }
  return joints;
}

// min sum |limb - target|^2 + rest |angles|^2 + smooth |angles - previous|^2 within the bounds;
// projected Levenberg-Marquardt over root rotation (left increments) and angles.
class DirectionFit {
 public:
  explicit DirectionFit(const Skeleton& skeleton)
      : skeleton_(skeleton),
        joints_(SkeletonJoints(skeleton)),
        num_hinges_(static_cast<int>(skeleton.hinges.size())),
        lower_(skeleton.LowerBounds().tail(num_hinges_)),
        upper_(skeleton.UpperBounds().tail(num_hinges_)) {}

  struct Solution {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::VectorXd angles;
    double cost = 0;
  };

  Solution Solve(const LimbDirections& target, const Solution& start,
                 const Eigen::VectorXd* previous) {
    constexpr int kMaxIterations = 60;
    Solution best = start;
    best.angles = best.angles.cwiseMax(lower_).cwiseMin(upper_);
    best.cost = Linearise(target, best, previous);
    double damping = 1e-4;
    for (int iteration = 0; iteration < kMaxIterations && damping < 1e6; ++iteration) {
      const Eigen::VectorXd step = Step(best, damping);
      Solution candidate;
      candidate.rotation = ExpSO3(step.head<3>()) * best.rotation;
      candidate.angles = (best.angles + step.tail(num_hinges_)).cwiseMax(lower_).cwiseMin(upper_);
      candidate.cost = Linearise(target, candidate, previous);
      if (candidate.cost < best.cost) {
        const bool converged = best.cost - candidate.cost < 1e-9 * best.cost + 1e-14;
        best = candidate;
        damping = std::max(1e-7, 0.2 * damping);
        if (converged) break;
      } else {
        damping *= 10;
        Linearise(target, best, previous);
      }
    }
    return best;
  }

  // Angle between each limb and its target, rad; NaN for limbs without a target.
  Eigen::VectorXd AngleErrors(const LimbDirections& target, const Solution& solution) {
    Place(solution);
    Eigen::VectorXd errors(kNumLimbs);
    for (int l = 0; l < kNumLimbs; ++l) {
      errors[l] = target.col(l).isZero()
                      ? std::numeric_limits<double>::quiet_NaN()
                      : 2 * std::asin(std::min(
                                1.0, 0.5 * (LimbVector(l).normalized() - target.col(l)).norm()));
    }
    return errors;
  }

  // Positions of the 16 joints with the root at the origin.
  Eigen::Matrix<double, 3, kNumPaperJoints> JointsAtOrigin(const Solution& solution) {
    Place(solution);
    Eigen::Matrix<double, 3, kNumPaperJoints> joints;
    for (int j = 0; j < kNumPaperJoints; ++j) joints.col(j) = state_.joints.col(joints_[j]);
    return joints;
  }

  int num_hinges() const { return num_hinges_; }

 private:
  void Place(const Solution& solution) {
    pose_.setZero(skeleton_.num_dofs());
    pose_.tail(num_hinges_) = solution.angles;
    ForwardKinematics(skeleton_, pose_, solution.rotation, &state_);
  }

  int Index(JointId joint) const { return joints_[static_cast<size_t>(joint)]; }

  Eigen::Vector3d LimbVector(int limb) const {
    const auto point = [&](const std::array<JointId, 2>& ends) -> Eigen::Vector3d {
      return 0.5 * (state_.joints.col(Index(ends[0])) + state_.joints.col(Index(ends[1])));
    };
    return point(kLimbs[limb].to) - point(kLimbs[limb].from);
  }

  // Normal equations at a solution; returns its cost.
  double Linearise(const LimbDirections& target, const Solution& solution,
                   const Eigen::VectorXd* previous) {
    constexpr double kRestWeight = 0.02 * 0.02;
    constexpr double kSmoothWeight = 0.05 * 0.05;
    Place(solution);
    JointJacobian(skeleton_, state_, &joint_jacobian_);
    const int num_free = 3 + num_hinges_;
    normal_.setZero(num_free, num_free);
    gradient_.setZero(num_free);
    double cost = 0;
    for (int l = 0; l < kNumLimbs; ++l) {
      if (target.col(l).isZero()) continue;
      const Eigen::Vector3d vector = LimbVector(l);
      const double length = vector.norm();
      const Eigen::Vector3d direction = vector / length;
      const auto rows = [&](const std::array<JointId, 2>& ends) -> Eigen::MatrixXd {
        return 0.5 * (joint_jacobian_.middleRows<3>(3 * Index(ends[0])) +
                      joint_jacobian_.middleRows<3>(3 * Index(ends[1])));
      };
      const Eigen::Matrix3d tangent =
          (Eigen::Matrix3d::Identity() - direction * direction.transpose()) / length;
      const Eigen::MatrixXd jacobian =
          tangent * (rows(kLimbs[l].to) - rows(kLimbs[l].from)).rightCols(num_free);
      const Eigen::Vector3d residual = direction - target.col(l);
      normal_.noalias() += jacobian.transpose() * jacobian;
      gradient_.noalias() += jacobian.transpose() * residual;
      cost += residual.squaredNorm();
    }
    const auto pull = [&](const Eigen::VectorXd& offset, double weight) {
      normal_.diagonal().tail(num_hinges_).array() += weight;
      gradient_.tail(num_hinges_) += weight * offset;
      cost += weight * offset.squaredNorm();
    };
    pull(solution.angles, kRestWeight);
    if (previous != nullptr) pull(solution.angles - *previous, kSmoothWeight);
    return cost;
  }

  // Damped step; angles that would leave their bounds stand still.
  Eigen::VectorXd Step(const Solution& at, double damping) const {
    Eigen::MatrixXd system = normal_;
    Eigen::VectorXd right = -gradient_;
    system.diagonal().array() += damping;
    for (int h = 0; h < num_hinges_; ++h) {
      const bool stuck = (at.angles[h] <= lower_[h] && right[3 + h] < 0) ||
                         (at.angles[h] >= upper_[h] && right[3 + h] > 0);
      if (!stuck) continue;
      system.row(3 + h).setZero();
      system.col(3 + h).setZero();
      system(3 + h, 3 + h) = 1;
      right[3 + h] = 0;
    }
    return system.ldlt().solve(right);
  }

  const Skeleton& skeleton_;
  std::array<int, kNumPaperJoints> joints_;
  int num_hinges_;
  Eigen::VectorXd lower_;
  Eigen::VectorXd upper_;
  KinematicState state_;
  Eigen::VectorXd pose_;
  Eigen::MatrixXd joint_jacobian_;
  Eigen::MatrixXd normal_;
  Eigen::VectorXd gradient_;
};

// Root rotation from the hip line and the trunk.
Eigen::Matrix3d TrunkRotation(const LimbDirections& directions) {
  const Eigen::Vector3d left = directions.col(0);
  const Eigen::Vector3d forward = left.cross(Eigen::Vector3d(directions.col(1))).normalized();
  if (!forward.allFinite()) return Eigen::Matrix3d::Identity();
  Eigen::Matrix3d rotation;
  rotation << left, forward.cross(left), forward;
  return rotation;
}

// Angles to start from: rest, arms hanging, crouching, arms raised.
std::vector<Eigen::VectorXd> StartAngles(const Skeleton& skeleton) {
  struct Setting {
    std::string_view hinge;  // matched at the end of the name, so both sides alike
    double angle_deg;
  };
  const std::vector<std::vector<Setting>> starts = {
      {},
      {{"shoulder_abduction", -70}, {"elbow_flexion", 20}, {"knee_flexion", 10}},
      {{"shoulder_abduction", -60},
       {"shoulder_flexion", 60},
       {"elbow_flexion", 60},
       {"hip_flexion", 80},
       {"knee_flexion", 90},
       {"spine_flexion", 30}},
      {{"shoulder_abduction", 60}, {"elbow_flexion", 30}, {"knee_flexion", 20}},
  };
  std::vector<Eigen::VectorXd> angles;
  for (const std::vector<Setting>& start : starts) {
    Eigen::VectorXd pose = Eigen::VectorXd::Zero(static_cast<int>(skeleton.hinges.size()));
    for (const Setting& setting : start) {
      for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
        if (skeleton.hinges[h].name.ends_with(setting.hinge)) {
          pose[h] = setting.angle_deg * kDegree;
        }
      }
    }
    angles.push_back(pose);
  }
  return angles;
}

double LegLength(const Eigen::Matrix3Xd& positions, const std::array<int, 6>& joints) {
  double length = 0;
  for (int side = 0; side < 2; ++side) {
    for (int bone = 0; bone < 2; ++bone) {
      length += 0.5 * (positions.col(joints[2 * bone + side]) -
                       positions.col(joints[2 * bone + 2 + side]))
                          .norm();
    }
  }
  return length;
}

}  // namespace

void SourceMotion::Validate() const {
  const auto num_joints = static_cast<int>(names.size());
  std::string faults;
  const auto fault = [&](const std::string& text) {
    faults += (faults.empty() ? "" : "; ") + text;
  };
  if (joint_positions.empty()) fault("no frames");
  if (!(fps > 0) || !std::isfinite(fps)) fault(fmt::format("{} frames per second", fps));
  if (parents.size() != names.size()) {
    fault(fmt::format("{} parents for {} joints", parents.size(), names.size()));
  }
  for (size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] < -1 || parents[j] >= static_cast<int>(j)) {
      fault(fmt::format("joint {} has parent {}", j, parents[j]));
      break;
    }
  }
  for (size_t f = 0; f < joint_positions.size(); ++f) {
    if (joint_positions[f].cols() != num_joints || !joint_positions[f].allFinite()) {
      fault(fmt::format("frame {} has not {} finite positions", f, num_joints));
      break;
    }
  }
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid motion: " + faults);
}

Eigen::MatrixXd Retarget(const Skeleton& skeleton, const SourceMotion& source,
                         RetargetSummary* summary) {
  skeleton.Validate();
  source.Validate();
  const JointMap map = MapJoints(source);
  const auto num_frames = static_cast<Eigen::Index>(source.joint_positions.size());

  KinematicState rest;
  ForwardKinematics(skeleton, ZeroPose(skeleton), &rest);
  const std::array<int, kNumPaperJoints> ours = SkeletonJoints(skeleton);
  const Eigen::Vector3d rest_foot = rest.joints.col(ours[static_cast<size_t>(kLeftToe)]) -
                                    rest.joints.col(ours[static_cast<size_t>(kLeftAnkle)]);
  std::vector<LimbDirections> targets;
  for (const Eigen::Matrix3Xd& positions : source.joint_positions) {
    targets.push_back(SourceDirections(map, positions));
  }
  LevelFeet(map, source, PitchDown(rest_foot.normalized()), &targets);

  std::array<int, 6> our_legs{};
  std::array<int, 6> source_legs{};
  for (int i = 0; i < 6; ++i) {
    our_legs[i] = ours[static_cast<size_t>(kLeftHip) + i];
    source_legs[i] = map[static_cast<size_t>(kLeftHip) + i];
  }
  const double our_leg = LegLength(rest.joints, our_legs);
  const double source_leg = LegLength(source.joint_positions.front(), source_legs);
  if (!(source_leg > 0)) {
    throw Error(ErrorCode::kInvalidArgument, "the motion's legs have no length");
  }
  const double scale = our_leg / source_leg;

  DirectionFit fit(skeleton);
  const std::vector<Eigen::VectorXd> starts = StartAngles(skeleton);
  DirectionFit::Solution solution;
  Eigen::MatrixXd poses(skeleton.num_dofs(), num_frames);
  Eigen::VectorXd source_low(num_frames);
  double error_sum = 0;
  double error_max = 0;
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const LimbDirections& target = targets[f];
    if (f == 0) {
      solution.cost = std::numeric_limits<double>::infinity();
      for (const Eigen::VectorXd& angles : starts) {
        const DirectionFit::Solution candidate =
            fit.Solve(target, {TrunkRotation(target), angles, 0}, nullptr);
        if (candidate.cost < solution.cost) solution = candidate;
      }
    } else {
      const Eigen::VectorXd previous = solution.angles;
      solution = fit.Solve(target, solution, &previous);
    }
    const Eigen::VectorXd errors = fit.AngleErrors(target, solution);
    const Eigen::VectorXd known = errors.array().isNaN().select(0, errors);
    const double frame_error = known.sum() / static_cast<double>((errors.array() >= 0).count());
    error_sum += frame_error;
    error_max = std::max(error_max, frame_error);

    // The middle of the hips follows the source's; the height is corrected so that the lowest
    // joint is as far above the floor as the source's lowest.
    const Eigen::Matrix3Xd& positions = source.joint_positions[f];
    const Eigen::Matrix<double, 3, kNumPaperJoints> joints = fit.JointsAtOrigin(solution);
    const auto hip_middle = [&](const Eigen::Matrix3Xd& x, int left, int right) {
      return Eigen::Vector3d(0.5 * (x.col(left) + x.col(right)));
    };
    const auto left_hip = static_cast<int>(kLeftHip);
    const auto right_hip = static_cast<int>(kRightHip);
    Eigen::Vector3d root = scale * hip_middle(positions, map[left_hip], map[right_hip]) -
                           hip_middle(joints, left_hip, right_hip);
    std::vector<double> source_heights;
    std::vector<double> our_heights;
    for (int j = 0; j < kNumPaperJoints; ++j) {
      if (map[j] < 0) continue;
      source_heights.push_back(scale * positions(1, map[j]));
      our_heights.push_back(joints(1, j));
    }
    const auto low = [our_leg](const std::vector<double>& heights) {
      return SoftMin(Eigen::Map<const Eigen::VectorXd>(heights.data(), heights.size()),
                     0.01 * our_leg);
    };
    source_low[f] = low(source_heights);
    root.y() = source_low[f] - low(our_heights);

    poses.col(f) << root, LogSO3(solution.rotation), solution.angles;
  }
  // The floor: the height of the lowest joint that only one frame in twenty goes below.
  Eigen::VectorXd sorted = source_low;
  std::sort(sorted.begin(), sorted.end());
  poses.row(1).array() -= sorted[(num_frames - 1) / 20];

  if (summary != nullptr) {
    summary->mean_direction_error_rad = error_sum / static_cast<double>(num_frames);
    summary->max_direction_error_rad = error_max;
    summary->scale = scale;
  }
  return poses;
}

}  // namespace mpc
