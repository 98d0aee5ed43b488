#include "mpc/pose/detection_repair.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace mpc {
namespace {

constexpr double kFps = 30;
constexpr int kFrames = 60;

// Two joints: one swings at 1 Hz, one stands still and spans the person's extent.
Eigen::Vector2d Track(int joint, int f) {
  if (joint == 1) return {300, 900};
  const double phase = 2 * M_PI * f / kFps;
  return {500 + 40 * std::sin(phase), 300 + 20 * std::cos(phase)};
}

Detections2d Clip(double sigma_px, unsigned seed = 1) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  Detections2d clip;
  clip.width = 1000;
  clip.height = 1000;
  clip.joints = {JointId::kLeftWrist, JointId::kLeftAnkle};
  for (int f = 0; f < kFrames; ++f) {
    Detections2d::Frame frame;
    frame.pixels.resize(2, 2);
    for (int j = 0; j < 2; ++j) {
      frame.pixels.col(j) = Track(j, f) + sigma_px * Eigen::Vector2d(normal(rng), normal(rng));
    }
    frame.confidence = Eigen::Vector2d(0.8, 0.6);
    clip.frames.push_back(frame);
  }
  return clip;
}

TEST(RepairDetectionsTest, WhatAgreesWithItsNeighboursStays) {
  for (const double sigma : {0.0, 2.0}) {
    const Detections2d clip = Clip(sigma);
    const Detections2d repaired = RepairDetections(clip, kFps);
    int changed = 0;
    for (int f = 0; f < kFrames; ++f) {
      changed += repaired.frames[f].pixels != clip.frames[f].pixels ? 1 : 0;
    }
    EXPECT_EQ(changed, 0) << sigma;
  }
}

TEST(RepairDetectionsTest, OutliersAreReplacedFromTheTrack) {
  Detections2d clip = Clip(1);
  for (const int f : {10, 11, 30}) clip.frames[f].pixels.col(0).x() += 150;
  const Detections2d repaired = RepairDetections(clip, kFps);
  for (const int f : {10, 11, 30}) {
    EXPECT_LT((repaired.frames[f].pixels.col(0) - Track(0, f)).norm(), 8) << f;
    EXPECT_NEAR(repaired.frames[f].confidence[0], 0.4, 1e-9);
  }
  EXPECT_EQ(repaired.frames[20].pixels, clip.frames[20].pixels);
}

TEST(RepairDetectionsTest, ShortGapsAreFilledLongOnesAreNot) {
  Detections2d clip = Clip(1);
  for (const int f : {12, 13}) clip.frames[f].confidence[0] = 0;
  for (int f = 25; f < 45; ++f) clip.frames[f].confidence[0] = 0;
  clip.frames[0].confidence[0] = 0;  // nothing before it
  const Detections2d repaired = RepairDetections(clip, kFps);
  for (const int f : {12, 13}) {
    EXPECT_LT((repaired.frames[f].pixels.col(0) - Track(0, f)).norm(), 5) << f;
    EXPECT_GT(repaired.frames[f].confidence[0], 0);
  }
  for (int f = 27; f < 43; ++f) EXPECT_EQ(repaired.frames[f].confidence[0], 0) << f;
  EXPECT_EQ(repaired.frames[0].confidence[0], 0);
}

// A jump that stays is motion, not an outlier.
TEST(RepairDetectionsTest, AStepIsKept) {
  Detections2d clip = Clip(0.5);
  for (int f = 30; f < kFrames; ++f) clip.frames[f].pixels.col(1).x() += 200;
  const Detections2d repaired = RepairDetections(clip, kFps);
  for (int f = 0; f < kFrames; ++f) {
    if (std::abs(f - 30) < 4) continue;
    EXPECT_EQ(repaired.frames[f].pixels.col(1), clip.frames[f].pixels.col(1)) << f;
  }
}

TEST(RepairDetectionsTest, PositionsAsPixels) {
  Detections3d clip;
  clip.joints = {JointId::kLeftWrist};
  for (int f = 0; f < kFrames; ++f) {
    Detections3d::Frame frame;
    frame.positions = Eigen::Vector3d(0.3 * std::sin(0.1 * f), 0.2, 0.01 * f);
    frame.confidence = Eigen::VectorXd::Ones(1);
    clip.frames.push_back(frame);
  }
  Detections3d broken = clip;
  broken.frames[20].positions.col(0).z() += 0.5;
  broken.frames[40].confidence[0] = 0;
  const Detections3d repaired = RepairDetections(broken, kFps);
  for (const int f : {20, 40}) {
    EXPECT_LT((repaired.frames[f].positions - clip.frames[f].positions).norm(), 0.01) << f;
    EXPECT_EQ(repaired.frames[f].confidence[0], 0.5);
  }
}

TEST(RepairDetectionsTest, FewFramesPerSecondOrFewFramesStay) {
  Detections2d clip = Clip(1);
  clip.frames[10].pixels.col(0).x() += 150;
  EXPECT_EQ(RepairDetections(clip, 10).frames[10].pixels, clip.frames[10].pixels);
  clip.frames.resize(3);
  EXPECT_EQ(RepairDetections(clip, kFps).frames.size(), 3u);
  clip.frames.clear();
  EXPECT_TRUE(RepairDetections(clip, kFps).frames.empty());
}

// Faster videos are thinned, not looked at for a shorter time.
TEST(RepairDetectionsTest, AnyFrameRate) {
  for (const double fps : {15.0, 60.0, 240.0}) {
    Detections2d clip = Clip(0.5);
    clip.frames[30].pixels.col(1).x() += 200;
    const Detections2d repaired = RepairDetections(clip, fps);
    EXPECT_LT((repaired.frames[30].pixels.col(1) - Track(1, 30)).norm(), 5) << fps;
  }
}

}  // namespace
}  // namespace mpc
