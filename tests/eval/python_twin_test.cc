// All metrics on random data against an implementation that shares no line with ours
// (metrics_reference.py, numpy).

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "io/run_program.h"
#include "io/temp_dir.h"
#include "mpc/eval/foot_skate.h"
#include "mpc/eval/metrics.h"
#include "mpc/eval/surface_metrics.h"
#include "random_surface.h"

namespace mpc {
namespace {

using nlohmann::json;

constexpr double kFps = 25;
constexpr int kNumFrames = 12;
const Eigen::Vector3d kWorldUp(0.36, 0.48, 0.8);
const Eigen::Vector3d kBeforeCamera(0, 0, 6);

// NaN becomes null, which numpy reads as NaN again.
json PointJson(const Eigen::Vector3d& x) {
  return x.allFinite() ? json{x.x(), x.y(), x.z()} : json{nullptr, nullptr, nullptr};
}

// 3J x F as F x J x 3.
template <typename Derived>
json TrackJson(const Eigen::MatrixBase<Derived>& track) {
  json frames = json::array();
  for (Eigen::Index f = 0; f < track.cols(); ++f) {
    json frame = json::array();
    for (Eigen::Index row = 0; row < track.rows(); row += 3) {
      frame.push_back(PointJson(track.col(f).template segment<3>(row).template cast<double>()));
    }
    frames.push_back(frame);
  }
  return frames;
}

json MaskJson(const cv::Mat& mask) {
  json rows = json::array();
  for (int y = 0; y < mask.rows; ++y) {
    rows.push_back(std::vector<int>(mask.ptr<uchar>(y), mask.ptr<uchar>(y) + mask.cols));
  }
  return rows;
}

class PythonTwinTest : public ::testing::Test {
 protected:
  PythonTwinTest() {
    const auto noise = [&](double size) {
      return Eigen::MatrixXd::NullaryExpr(3 * joints_.size(), kNumFrames,
                                          [this, size] { return size * normal_(random_); });
    };
    truth_ = noise(0.5);
    // Toes that stand most of the time, one of them now and then a little up.
    for (const JointId foot : {JointId::kLeftToe, JointId::kRightToe}) {
      const int row = 3 * Index(foot);
      for (int f = 1; f < kNumFrames; ++f) {
        const double step = f % 4 == 0 ? 0.3 : 0.002;
        truth_.col(f).segment<3>(row) =
            truth_.col(f - 1).segment<3>(row) + step * (noise(1).col(0).head<3>());
      }
    }
    estimate_ = truth_ + noise(0.05);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    estimate_.block<3, 1>(3 * Index(JointId::kLeftElbow), 4).setConstant(nan);
    truth_.block<3, 1>(3 * Index(JointId::kRightKnee), 7).setConstant(nan);
    estimate_.block<3, 1>(3 * Index(JointId::kLeftHip), 2).setConstant(nan);
    for (cv::Mat* mask : {&mask_a_, &mask_b_}) {
      *mask = cv::Mat::zeros(40, 50, CV_8UC1);
      for (int i = 0; i < 6; ++i) {
        std::uniform_int_distribution<int> place(-5, 35);
        cv::Rect rect(place(random_) + 5, place(random_), 12, 10);
        (*mask)(rect & cv::Rect(0, 0, 50, 40)) = 1;
      }
    }
  }

  int Index(JointId id) const {
    return static_cast<int>(std::find(joints_.begin(), joints_.end(), id) - joints_.begin());
  }

  // What the script says to `data`.
  static json AskPython(const json& data) {
    testing::TempDir folder;
    const auto file = folder.Write("data.json", data.dump());
    const testing::ProgramResult run = testing::RunProgram(
        "/usr/bin/python3 '" MPC_METRICS_REFERENCE "' < '" + file.string() + "'");
    EXPECT_EQ(run.status, 0) << run.output;
    return json::parse(run.output, nullptr, /*allow_exceptions=*/false);
  }

  std::mt19937_64 random_{11};
  std::normal_distribution<double> normal_;
  std::vector<JointId> joints_{ScoredJoints14().begin(), ScoredJoints14().end()};
  Eigen::MatrixXd truth_;
  Eigen::MatrixXd estimate_;
  cv::Mat mask_a_;
  cv::Mat mask_b_;
};

TEST_F(PythonTwinTest, Agrees) {
  Camera camera = Camera::FromFov(640, 480, 1);
  camera.fy = 600;
  const std::vector<JointPair> bones = {{JointId::kLeftHip, JointId::kLeftKnee},
                                        {JointId::kRightElbow, JointId::kRightWrist}};
  Detections2d detections;
  detections.joints = joints_;
  json pixels = json::array();
  for (int f = 0; f < kNumFrames; ++f) {
    Eigen::Matrix2Xd frame = Eigen::Matrix2Xd::NullaryExpr(
        2, joints_.size(), [&] { return 300 + 100 * normal_(random_); });
    json frame_json = json::array();
    for (const auto& pixel : frame.colwise()) frame_json.push_back({pixel.x(), pixel.y()});
    pixels.push_back(frame_json);
    detections.frames.push_back({frame, Eigen::VectorXd::Ones(joints_.size())});
  }
  const testing::RandomSurface surface(24, 5);
  std::vector<Eigen::Matrix3Xf> estimates, truths;
  json estimates_json = json::array(), truths_json = json::array();
  for (int f = 0; f < 2; ++f) {
    truths.push_back(surface.positions.array() * float(1 + 0.1 * f));
    estimates.push_back((truths.back() + 0.05F * Eigen::Matrix3Xf::NullaryExpr(
                                                     3, truths.back().cols(),
                                                     [&] { return float(normal_(random_)); }))
                            .colwise() +
                        Eigen::Vector3f(0.3F, -0.2F, 1));
    truths_json.push_back(TrackJson(truths.back().reshaped())[0]);
    estimates_json.push_back(TrackJson(estimates.back().reshaped())[0]);
  }
  json triangles = json::array();
  for (const auto& t : surface.triangles.colwise()) triangles.push_back({t[0], t[1], t[2]});
  const ContactOptions contacts;

  const json python = AskPython(
      {{"estimate", TrackJson(estimate_)},
       {"truth", TrackJson(truth_)},
       {"left_hip", Index(JointId::kLeftHip)},
       {"right_hip", Index(JointId::kRightHip)},
       {"bones", {{Index(bones[0].a), Index(bones[0].b)}, {Index(bones[1].a), Index(bones[1].b)}}},
       {"feet",
        {Index(JointId::kLeftAnkle), Index(JointId::kRightAnkle), Index(JointId::kLeftToe),
         Index(JointId::kRightToe)}},
       {"fps", kFps},
       {"up", PointJson(kWorldUp)},
       {"max_speed", contacts.max_speed},
       {"max_height", contacts.max_height},
       {"camera", {{"fx", camera.fx}, {"fy", camera.fy}, {"cx", camera.cx}, {"cy", camera.cy}}},
       {"before_camera", PointJson(kBeforeCamera)},
       {"pixels", pixels},
       {"mask_a", MaskJson(mask_a_)},
       {"mask_b", MaskJson(mask_b_)},
       {"tolerance", 2},
       {"vertices_estimate", estimates_json},
       {"vertices_truth", truths_json},
       {"triangles", triangles}});
  ASSERT_TRUE(python.is_object());
  const auto expect = [&](const char* name, double ours, double tolerance = 1e-8) {
    EXPECT_NEAR(ours, python.at(name).get<double>(), tolerance) << name;
    EXPECT_GT(ours, 0) << name;
  };

  const JointErrors errors = CompareJoints(joints_, estimate_, truth_);
  expect("absolute", errors.absolute.mean_mm);
  expect("mpjpe", errors.root.mean_mm);
  expect("n_mpjpe", errors.scale.mean_mm);
  expect("pa_mpjpe", errors.similarity.mean_mm);
  expect("root", errors.place.mean_mm);
  expect("jitter", Jitter(estimate_, kFps).mean_mm_per_frame2);
  expect("acceleration", AccelerationError(estimate_, truth_, kFps).mean_mm_per_frame2);
  expect("bones", CompareBoneLengths(joints_, estimate_, bones).mean_mm);
  expect("skate", CompareFootSkate(joints_, estimate_, truth_, kFps, kWorldUp, contacts).mean_mm);
  Eigen::MatrixXd in_camera = estimate_;
  for (Eigen::Index row = 2; row < in_camera.rows(); row += 3) {
    in_camera.row(row).array() += kBeforeCamera.z();
  }
  expect("reprojection", CompareReprojection(camera, joints_, in_camera, detections).mean_px);
  expect("iou", MaskIou(mask_a_, mask_b_));
  expect("boundary_f", BoundaryF(mask_a_, mask_b_, 2));
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (size_t f = 0; f < truths.size(); ++f) {
    translation += MeanOffset(estimates[f], truths[f]) / static_cast<double>(truths.size());
  }
  SurfaceError mean;
  for (size_t f = 0; f < truths.size(); ++f) {
    const SurfaceError error =
        CompareSurfaces(estimates[f], truths[f], surface.triangles, translation);
    mean.vertex_mm += error.vertex_mm / static_cast<double>(truths.size());
    mean.surface_mm += error.surface_mm / static_cast<double>(truths.size());
  }
  expect("vertex", mean.vertex_mm);
  expect("surface", mean.surface_mm);
}

}  // namespace
}  // namespace mpc
