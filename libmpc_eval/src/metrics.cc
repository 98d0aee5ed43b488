#include "mpc/eval/metrics.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "mpc/core/error.h"
#include "mpc/core/units.h"

namespace mpc {
namespace {

void RequireSameSize(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("joint trajectories of {} x {} and {} x {} cannot be compared",
                            a.rows(), a.cols(), b.rows(), b.cols()));
  }
}

void RequireJointRows(const Eigen::MatrixXd& trajectories, size_t num_joints) {
  if (trajectories.rows() != static_cast<Eigen::Index>(3 * num_joints)) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("joint trajectories have {} rows, expected 3 for each of {} joints",
                            trajectories.rows(), num_joints));
  }
}

Eigen::Index IndexOf(std::span<const JointId> joints, JointId joint) {
  const auto it = std::find(joints.begin(), joints.end(), joint);
  return it == joints.end() ? -1 : it - joints.begin();
}

// The joints of one frame that both inputs have.
struct FramePair {
  std::vector<Eigen::Index> joints;
  Eigen::Matrix3Xd estimate;
  Eigen::Matrix3Xd truth;
};

FramePair PresentJoints(const Eigen::MatrixXd& estimate, const Eigen::MatrixXd& truth,
                        Eigen::Index frame) {
  FramePair pair;
  for (Eigen::Index j = 0; 3 * j < estimate.rows(); ++j) {
    if (estimate.col(frame).segment<3>(3 * j).allFinite() &&
        truth.col(frame).segment<3>(3 * j).allFinite()) {
      pair.joints.push_back(j);
    }
  }
  const auto count = static_cast<Eigen::Index>(pair.joints.size());
  pair.estimate.resize(3, count);
  pair.truth.resize(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index j = pair.joints[static_cast<size_t>(i)];
    pair.estimate.col(i) = estimate.col(frame).segment<3>(3 * j);
    pair.truth.col(i) = truth.col(frame).segment<3>(3 * j);
  }
  return pair;
}

// Pelvis, else the middle of the hips; NaN when the frame has neither.
Eigen::Vector3d Root(std::span<const JointId> joints, const FramePair& pair,
                     const Eigen::Matrix3Xd& positions) {
  const auto column = [&](JointId id) -> Eigen::Index {
    const auto it = std::find(pair.joints.begin(), pair.joints.end(), IndexOf(joints, id));
    return it == pair.joints.end() ? -1 : it - pair.joints.begin();
  };
  if (const Eigen::Index pelvis = column(JointId::kPelvis); pelvis >= 0) {
    return positions.col(pelvis);
  }
  const Eigen::Index left = column(JointId::kLeftHip);
  const Eigen::Index right = column(JointId::kRightHip);
  if (left < 0 || right < 0) return Eigen::Vector3d::Constant(kNan);
  return 0.5 * (positions.col(left) + positions.col(right));
}

// Accumulates the distances of one alignment over the frames.
class ErrorSum {
 public:
  ErrorSum(std::string alignment, Eigen::Index num_joints, Eigen::Index num_frames)
      : joint_sum_(Eigen::VectorXd::Zero(num_joints)),
        joint_count_(Eigen::VectorXi::Zero(num_joints)) {
    result_.alignment = std::move(alignment);
    result_.per_frame_mm = Eigen::VectorXd::Constant(num_frames, kNan);
    result_.each_mm = Eigen::MatrixXd::Constant(num_joints, num_frames, kNan);
  }

  void Add(Eigen::Index frame, const std::vector<Eigen::Index>& joints,
           const Eigen::Matrix3Xd& estimate, const Eigen::Matrix3Xd& truth) {
    if (joints.empty()) return;
    const Eigen::VectorXd distance = kMmPerMetre * (estimate - truth).colwise().norm().transpose();
    result_.per_frame_mm[frame] = distance.mean();
    result_.num_frames += 1;
    result_.num_observations += static_cast<int>(joints.size());
    for (size_t i = 0; i < joints.size(); ++i) {
      result_.each_mm(joints[i], frame) = distance[static_cast<Eigen::Index>(i)];
      joint_sum_[joints[i]] += distance[static_cast<Eigen::Index>(i)];
      joint_count_[joints[i]] += 1;
    }
  }

  AlignedError Finish() {
    // 0 / 0 is the NaN that says "never scored".
    result_.per_joint_mm = joint_sum_.cwiseQuotient(joint_count_.cast<double>());
    result_.mean_mm = joint_sum_.sum() / result_.num_observations;
    return std::move(result_);
  }

 private:
  AlignedError result_;
  Eigen::VectorXd joint_sum_;
  Eigen::VectorXi joint_count_;
};

}  // namespace

JointErrors CompareJoints(std::span<const JointId> joints, const Eigen::MatrixXd& estimate,
                          const Eigen::MatrixXd& truth) {
  RequireSameSize(estimate, truth);
  RequireJointRows(estimate, joints.size());
  const auto num_joints = static_cast<Eigen::Index>(joints.size());
  const Eigen::Index num_frames = estimate.cols();

  JointErrors errors;
  errors.joints.assign(joints.begin(), joints.end());
  errors.num_frames = static_cast<int>(num_frames);
  ErrorSum absolute("none", num_joints, num_frames);
  ErrorSum root("root translation", num_joints, num_frames);
  ErrorSum scale("root translation and scale", num_joints, num_frames);
  ErrorSum similarity("similarity", num_joints, num_frames);
  ErrorSum place("none", 1, num_frames);

  for (Eigen::Index f = 0; f < num_frames; ++f) {
    const FramePair pair = PresentJoints(estimate, truth, f);
    errors.num_missing += static_cast<int>(num_joints - pair.truth.cols());
    absolute.Add(f, pair.joints, pair.estimate, pair.truth);

    const Eigen::Vector3d estimate_root = Root(joints, pair, pair.estimate);
    const Eigen::Vector3d truth_root = Root(joints, pair, pair.truth);
    if (estimate_root.allFinite()) {
      place.Add(f, {0}, estimate_root, truth_root);
      const Eigen::Matrix3Xd e = pair.estimate.colwise() - estimate_root;
      const Eigen::Matrix3Xd t = pair.truth.colwise() - truth_root;
      root.Add(f, pair.joints, e, t);
      if (e.squaredNorm() > 0) {
        scale.Add(f, pair.joints, (e.cwiseProduct(t).sum() / e.squaredNorm()) * e, t);
      }
    }
    if (pair.joints.size() >= 3) {
      const Eigen::Vector3d centre = pair.estimate.rowwise().mean();
      if ((pair.estimate.colwise() - centre).squaredNorm() > 0) {
        const Eigen::Matrix4d truth_from_estimate = Eigen::umeyama(pair.estimate, pair.truth, true);
        Eigen::Matrix3Xd aligned =
            (truth_from_estimate.topLeftCorner<3, 3>() * pair.estimate).colwise() +
            truth_from_estimate.topRightCorner<3, 1>();
        // Rounding must not make the best similarity worse than none: the truth is 0 from itself.
        if ((pair.estimate - pair.truth).squaredNorm() <= (aligned - pair.truth).squaredNorm()) {
          aligned = pair.estimate;
        }
        similarity.Add(f, pair.joints, aligned, pair.truth);
      }
    }
  }
  errors.absolute = absolute.Finish();
  errors.root = root.Finish();
  errors.scale = scale.Finish();
  errors.similarity = similarity.Finish();
  errors.place = place.Finish();
  return errors;
}

std::string FormatJointErrors(const JointErrors& errors) {
  std::string text;
  const auto add = [&](const char* name, const AlignedError& error) {
    text += fmt::format("{:<9} {:7.1f} mm  {} joints, aligned: {}, {} of {} frames\n", name,
                        error.mean_mm, errors.joints.size(), error.alignment, error.num_frames,
                        errors.num_frames);
  };
  add("absolute", errors.absolute);
  add("MPJPE", errors.root);
  add("N-MPJPE", errors.scale);
  add("PA-MPJPE", errors.similarity);
  text += fmt::format("{:<9} {:7.1f} mm  the root alone, aligned: {}, {} of {} frames\n", "root",
                      errors.place.mean_mm, errors.place.alignment, errors.place.num_frames,
                      errors.num_frames);
  return text;
}

Eigen::MatrixXd SelectJoints(const Eigen::MatrixXd& trajectories, std::span<const JointId> joints,
                             std::span<const JointId> wanted) {
  RequireJointRows(trajectories, joints.size());
  Eigen::MatrixXd selected = Eigen::MatrixXd::Constant(static_cast<Eigen::Index>(3 * wanted.size()),
                                                       trajectories.cols(), kNan);
  for (size_t i = 0; i < wanted.size(); ++i) {
    const Eigen::Index j = IndexOf(joints, wanted[i]);
    if (j >= 0) {
      selected.middleRows<3>(static_cast<Eigen::Index>(3 * i)) = trajectories.middleRows<3>(3 * j);
    }
  }
  return selected;
}

SecondDifference Jitter(const Eigen::MatrixXd& trajectories, double fps) {
  if (trajectories.rows() % 3 != 0) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("joint trajectories have {} rows, expected a multiple of 3",
                            trajectories.rows()));
  }
  double sum = 0;
  SecondDifference result;
  for (Eigen::Index f = 1; f + 1 < trajectories.cols(); ++f) {
    const Eigen::VectorXd second =
        trajectories.col(f - 1) - 2 * trajectories.col(f) + trajectories.col(f + 1);
    for (Eigen::Index row = 0; row < second.size(); row += 3) {
      const double length = second.segment<3>(row).norm();
      if (!std::isfinite(length)) continue;
      sum += length;
      result.num_observations += 1;
    }
  }
  result.mean_mm_per_frame2 = kMmPerMetre * sum / result.num_observations;
  result.mean_mm_per_s2 = result.mean_mm_per_frame2 * fps * fps;
  return result;
}

SecondDifference AccelerationError(const Eigen::MatrixXd& estimate, const Eigen::MatrixXd& truth,
                                   double fps) {
  RequireSameSize(estimate, truth);
  return Jitter(estimate - truth, fps);
}

BoneLengthDeviation CompareBoneLengths(std::span<const JointId> joints,
                                       const Eigen::MatrixXd& trajectories,
                                       std::span<const JointPair> bones) {
  RequireJointRows(trajectories, joints.size());
  BoneLengthDeviation result;
  double sum_of_deviations = 0;
  for (const JointPair& bone : bones) {
    const Eigen::Index a = IndexOf(joints, bone.a);
    const Eigen::Index b = IndexOf(joints, bone.b);
    if (a < 0 || b < 0) continue;
    std::vector<double> lengths;
    for (Eigen::Index f = 0; f < trajectories.cols(); ++f) {
      const double length =
          (trajectories.col(f).segment<3>(3 * a) - trajectories.col(f).segment<3>(3 * b)).norm();
      if (std::isfinite(length)) lengths.push_back(kMmPerMetre * length);
    }
    if (lengths.empty()) continue;
    const Eigen::Map<const Eigen::ArrayXd> all(lengths.data(),
                                               static_cast<Eigen::Index>(lengths.size()));
    const Eigen::ArrayXd off = all - all.mean();
    sum_of_deviations += std::sqrt(off.square().mean());
    result.max_mm = std::max(result.max_mm, off.abs().maxCoeff());
    result.num_bones += 1;
  }
  if (result.num_bones > 0) result.mean_mm = sum_of_deviations / result.num_bones;
  return result;
}

ReprojectionError CompareReprojection(const Camera& camera, std::span<const JointId> joints,
                                      const Eigen::MatrixXd& joints_in_camera,
                                      const Detections2d& detections) {
  RequireJointRows(joints_in_camera, joints.size());
  if (joints_in_camera.cols() != static_cast<Eigen::Index>(detections.frames.size())) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} frames of joints against {} of detections", joints_in_camera.cols(),
                            detections.frames.size()));
  }
  double sum = 0;
  ReprojectionError result;
  for (size_t i = 0; i < joints.size(); ++i) {
    const int column = FindColumn(detections.joints, joints[i]);
    for (size_t f = 0; f < detections.frames.size(); ++f) {
      const Eigen::Vector3d x = joints_in_camera.col(static_cast<Eigen::Index>(f))
                                    .segment<3>(static_cast<Eigen::Index>(3 * i));
      Eigen::Vector2d pixel;
      if (column < 0 || detections.frames[f].confidence[column] <= 0 || !x.allFinite() ||
          !Project(camera, x, &pixel)) {
        result.num_missing += 1;
        continue;
      }
      sum += (pixel - detections.frames[f].pixels.col(column)).norm();
      result.num_observations += 1;
    }
  }
  result.mean_px = sum / result.num_observations;
  return result;
}

double MaskIou(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != CV_8UC1 || b.type() != CV_8UC1) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("masks of {} x {} and {} x {} (8-bit, one channel expected)", a.cols,
                            a.rows, b.cols, b.rows));
  }
  if (a.empty()) return 1;
  const int both = cv::countNonZero((a != 0) & (b != 0));
  const int either = cv::countNonZero((a != 0) | (b != 0));
  return either == 0 ? 1.0 : static_cast<double>(both) / either;
}

IouSummary SummarizeIou(std::span<const double> iou_per_frame) {
  std::vector<double> scored;
  for (const double iou : iou_per_frame) {
    if (std::isfinite(iou)) scored.push_back(iou);
  }
  std::sort(scored.begin(), scored.end());
  const auto count = static_cast<Eigen::Index>(scored.size());
  const Eigen::Map<const Eigen::ArrayXd> sorted(scored.data(), count);
  const Eigen::Index worst = (count + 9) / 10;
  return {sorted.sum() / static_cast<double>(count),
          sorted.head(worst).sum() / static_cast<double>(worst), static_cast<int>(count)};
}

}  // namespace mpc
