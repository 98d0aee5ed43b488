#include "mpc/eval/synthetic.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>

#include "mpc/core/error.h"
#include "mpc/skeleton/kinematics.h"

namespace mpc {
namespace {

using enum JointId;

constexpr double kMetresPerMm = 1e-3;

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  double Normal() { return normal_(engine_); }
  double Uniform(double from, double to) { return from + (to - from) * uniform_(engine_); }
  bool Chance(double probability) { return uniform_(engine_) < probability; }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_{0, 1};
  std::uniform_real_distribution<double> uniform_{0, 1};
};

// A smooth stationary process of variance one: critically damped AR(2), the sampled Matern-3/2
// process. Its autocorrelation (1 + |t| / a) exp(-|t| / a) has the integral 2 a per side.
class SmoothNoise {
 public:
  SmoothNoise(double correlation_s, double fps, Random* random) : random_(random) {
    const double samples = 0.5 * correlation_s * fps;
    phi_ = samples > 0 ? std::exp(-1 / samples) : 0;
    const double q = 1 - phi_ * phi_;
    gain_ = std::sqrt(q * q * q / (1 + phi_ * phi_));
    const int burn_in = static_cast<int>(std::min(20 * samples, 1e5));
    for (int i = 0; i < burn_in; ++i) Next();
  }
  double Next() {
    first_ = phi_ * first_ + random_->Normal();
    second_ = phi_ * second_ + first_;
    return gain_ * second_;
  }

 private:
  Random* random_;
  double phi_ = 0;
  double gain_ = 1;
  double first_ = 0;
  double second_ = 0;
};

struct Limb {
  JointId root;
  std::array<JointId, 3> moving;
  int num_moving;
};
constexpr std::array<Limb, 4> kReversibleLimbs = {{
    {kLeftShoulder, {kLeftElbow, kLeftWrist, kLeftWrist}, 2},
    {kRightShoulder, {kRightElbow, kRightWrist, kRightWrist}, 2},
    {kLeftHip, {kLeftKnee, kLeftAnkle, kLeftToe}, 3},
    {kRightHip, {kRightKnee, kRightAnkle, kRightToe}, 3},
}};

// Per frame the limb whose depth is reversed, or -1: episodes of random length and limb, with
// pauses that make the episodes' share of the time `reversed_fraction`.
std::vector<int> ReversedLimbs(const DetectionNoise& noise, double fps, int num_frames,
                               Random* random) {
  std::vector<int> limb(static_cast<size_t>(num_frames), -1);
  if (noise.reversed_fraction <= 0) return limb;
  const double pause_per_episode = (1 - noise.reversed_fraction) / noise.reversed_fraction;
  const auto duration = [&] {
    return std::max(1.0, fps * random->Uniform(noise.reversal_min_s, noise.reversal_max_s));
  };
  double frame = -random->Uniform(0, 1) * pause_per_episode * duration();
  while (frame < num_frames) {
    frame += pause_per_episode * duration();
    const int which = static_cast<int>(random->Uniform(0, kReversibleLimbs.size()));
    const double end = frame + duration();
    for (; frame < std::min<double>(end, num_frames); ++frame) {
      if (frame >= 0) limb[static_cast<size_t>(frame)] = which;
    }
  }
  return limb;
}

void ReverseDepth(const Limb& limb, Eigen::Matrix3Xd* in_ray) {
  const double root = (*in_ray)(2, static_cast<int>(limb.root));
  for (int i = 0; i < limb.num_moving; ++i) {
    double& depth = (*in_ray)(2, static_cast<int>(limb.moving[i]));
    depth = 2 * root - depth;
  }
}

// Exchanges the columns of left and right joints.
template <typename Matrix>
void SwapSides(Matrix* columns) {
  for (int j = 0; j < kNumPaperJoints; ++j) {
    const int mirror = static_cast<int>(MirrorJoint(static_cast<JointId>(j)));
    if (mirror > j) columns->col(j).swap(columns->col(mirror));
  }
}

}  // namespace

DetectionNoise DetectionNoise::White(double sigma_px, double sigma_mm, double outlier_fraction,
                                     double dropped_fraction) {
  DetectionNoise noise;
  noise.sigma_px = sigma_px;
  noise.sigma_mm = sigma_mm;
  noise.outlier_fraction = outlier_fraction;
  noise.dropped_fraction = dropped_fraction;
  return noise;
}

DetectionNoise DetectionNoise::Measured() {
  DetectionNoise noise;
  noise.sigma_px = 3;
  noise.sigma_mm = 8;
  noise.bias_along_ray_mm = 90;
  noise.bias_across_ray_mm = 45;
  noise.reversed_fraction = 0.5;
  return noise;
}

DetectionNoise DetectionNoise::MeasuredWithFailures() {
  DetectionNoise noise = Measured();
  noise.outlier_fraction = 0.01;
  noise.dropped_fraction = 0.03;
  noise.swapped_fraction = 0.02;
  return noise;
}

void DetectionNoise::Validate() const {
  std::string faults;
  const auto check = [&](const char* name, double value, double maximum) {
    if (value >= 0 && value <= maximum) return;
    faults += fmt::format("{}{} is {}, expected 0 to {}", faults.empty() ? "" : "; ", name, value,
                          maximum);
  };
  check("sigma_px", sigma_px, 1e5);
  check("sigma_mm", sigma_mm, 1e5);
  check("outlier_fraction", outlier_fraction, 1);
  check("outlier_px", outlier_px, 1e5);
  check("outlier_mm", outlier_mm, 1e5);
  check("dropped_fraction", dropped_fraction, 1);
  check("bias_along_ray_mm", bias_along_ray_mm, 1e5);
  check("bias_across_ray_mm", bias_across_ray_mm, 1e5);
  check("bias_correlation_s", bias_correlation_s, 1e3);
  check("reversed_fraction", reversed_fraction, 1);
  check("reversal_min_s", reversal_min_s, reversal_max_s);
  check("reversal_max_s", reversal_max_s, 1e3);
  check("swapped_fraction", swapped_fraction, 1);
  for (const FrameRange& gap : gaps) {
    if (gap.begin < 0 || gap.end < gap.begin) {
      faults += fmt::format("{}gap from {} to {}", faults.empty() ? "" : "; ", gap.begin, gap.end);
    }
  }
  if (!faults.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "invalid detection noise: " + faults);
  }
}

SyntheticDetections SynthesizeDetections(const Skeleton& skeleton,
                                         const Eigen::MatrixXd& poses_in_camera,
                                         const Camera& camera, double fps,
                                         const DetectionNoise& noise, uint64_t seed) {
  noise.Validate();
  camera.Validate();
  if (poses_in_camera.rows() != skeleton.num_dofs() || !(fps > 0) || !std::isfinite(fps)) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("poses with {} rows at {} frames per second for a skeleton of {} dofs",
                            poses_in_camera.rows(), fps, skeleton.num_dofs()));
  }
  const int num_frames = static_cast<int>(poses_in_camera.cols());
  constexpr int kNumJoints = kNumPaperJoints;

  SyntheticDetections result;
  for (int j = 0; j < kNumJoints; ++j) {
    const auto id = static_cast<JointId>(j);
    if (j >= skeleton.num_joints() || skeleton.joints[j].id != id) {
      throw Error(ErrorCode::kInvalidArgument,
                  fmt::format("joint {} of the skeleton is not {}", j, JointName(id)));
    }
    result.joints.push_back(id);
  }
  result.truth = JointTrajectories(skeleton, poses_in_camera).topRows<3 * kNumJoints>();
  result.detections2d.width = camera.width;
  result.detections2d.height = camera.height;
  result.detections2d.joints = result.joints;
  result.detections3d.joints = result.joints;
  result.detections3d.ray_aligned = true;

  Random random(seed);
  std::vector<SmoothNoise> bias;
  for (int i = 0; i < 3 * kNumJoints; ++i)
    bias.emplace_back(noise.bias_correlation_s, fps, &random);
  const double across = noise.bias_across_ray_mm / std::sqrt(2.0);
  const Eigen::Vector3d bias_size =
      kMetresPerMm * Eigen::Vector3d(across, across, noise.bias_along_ray_mm);
  const std::vector<int> reversed = ReversedLimbs(noise, fps, num_frames, &random);

  for (int f = 0; f < num_frames; ++f) {
    const Eigen::Matrix3Xd truth = result.truth.col(f).reshaped(3, kNumJoints);
    const Eigen::Vector3d root =
        0.5 * (truth.col(static_cast<int>(kLeftHip)) + truth.col(static_cast<int>(kRightHip)));
    Detections2d::Frame frame2d;
    Detections3d::Frame frame3d;
    frame2d.pixels = Eigen::Matrix2Xd::Zero(2, kNumJoints);
    frame2d.confidence = Eigen::VectorXd::Zero(kNumJoints);
    const Eigen::Matrix3d camera_from_ray = CameraFromRay(root);
    frame3d.positions = camera_from_ray.transpose() * (truth.colwise() - root);
    frame3d.confidence = Eigen::VectorXd::Zero(kNumJoints);
    if (reversed[f] >= 0) ReverseDepth(kReversibleLimbs[reversed[f]], &frame3d.positions);

    for (int j = 0; j < kNumJoints; ++j) {
      // Every number is drawn whether it is used or not, so that one kind of noise does not
      // change the dice of another.
      Eigen::Vector3d white;
      Eigen::Vector3d slow;
      for (int axis = 0; axis < 3; ++axis) {
        white[axis] = random.Normal();
        slow[axis] = bias[3 * j + axis].Next();
      }
      Eigen::Vector2d white2d;
      for (int axis = 0; axis < 2; ++axis) white2d[axis] = random.Normal();
      const bool outlier3d = random.Chance(noise.outlier_fraction);
      const bool outlier2d = random.Chance(noise.outlier_fraction);
      const bool dropped = random.Chance(noise.dropped_fraction);
      const double confidence2d = random.Uniform(0.7, 1);
      const double confidence3d = random.Uniform(0.7, 1);

      frame3d.positions.col(j) +=
          kMetresPerMm * (outlier3d ? noise.outlier_mm : noise.sigma_mm) * white +
          bias_size.cwiseProduct(slow);
      Eigen::Vector2d pixel;
      const bool visible = Project(camera, truth.col(j), &pixel) && pixel.x() >= 0 &&
                           pixel.y() >= 0 && pixel.x() <= camera.width - 1 &&
                           pixel.y() <= camera.height - 1;
      if (visible) {
        frame2d.pixels.col(j) = pixel + (outlier2d ? noise.outlier_px : noise.sigma_px) * white2d;
      }
      if (!dropped) {
        frame2d.confidence[j] = visible ? confidence2d : 0;
        frame3d.confidence[j] = confidence3d;
      }
    }
    if (random.Chance(noise.swapped_fraction)) {
      SwapSides(&frame2d.pixels);
      SwapSides(&frame3d.positions);
    }
    for (const FrameRange& gap : noise.gaps) {
      if (f < gap.begin || f >= gap.end) continue;
      frame2d.confidence.setZero();
      frame3d.confidence.setZero();
    }
    result.detections2d.frames.push_back(std::move(frame2d));
    result.detections3d.frames.push_back(std::move(frame3d));
  }
  return result;
}

}  // namespace mpc
