// Accuracy on real motion: motion-capture clips performed by a rigged actor, seen with errors of
// known kinds. Default settings throughout, proportions as given and fitted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <numbers>
#include <string>

#include "eval/bvh_source.h"
#include "mpc/io/gltf.h"
#include "mpc/pose/frame_initializer.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/proportions.h"
#include "pose/synthetic_clip.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

using testing::FrameErrors;
using testing::SyntheticClip;

constexpr double kFps = 30;
constexpr int kMaxFrames = 150;
constexpr int kSeeds = 6;

Skeleton ActorSkeleton() {
  const RigAsset rig = ReadRigGltf(*testing::DataDir() / "actors" / "male_tpose.glb");
  return BuildCharacter(rig, MapRigByNames(rig)).skeleton;
}

// The clip seen from about 4 m, from another side with every seed.
SyntheticClip PerformBvh(const Skeleton& skeleton, const std::string& name,
                         const DetectionNoise& noise, uint64_t seed) {
  const SourceMotion source =
      testing::SourceFromBvh(ReadBvh(*testing::DataDir() / "mocap" / (name + ".bvh")));
  Eigen::MatrixXd poses = ResamplePoses(Retarget(skeleton, source), source.fps, kFps);
  poses = poses.leftCols(std::min<Eigen::Index>(kMaxFrames, poses.cols())).eval();
  const Eigen::Vector3d middle = poses.topRows<3>().rowwise().mean();
  const Eigen::Matrix3d turn = ExpSO3({0, 1.1 * static_cast<double>(seed), 0});
  poses = TransformPoses(turn, -(turn * Eigen::Vector3d(middle.x(), 0, middle.z())), poses);
  const double distance = std::max(4.0, 2.7 + poses.row(2).maxCoeff());
  SyntheticClip clip;
  clip.skeleton = skeleton;
  clip.fps = kFps;
  clip.poses = TransformPoses(ExpSO3({std::numbers::pi, 0, 0}), {0.1, 0.9, distance}, poses);
  clip.detections = SynthesizeDetections(skeleton, clip.poses, clip.camera, kFps, noise, seed);
  return clip;
}

// Bars of the project: 20 mm with white noise on smooth motion, which walk, jump and punch are; 50 mm
// with measured errors. Kick, roll and dance turn and strike too fast for white errors to average out:
// their bars are what was reached (docs/results.md), with room for another machine's last bits.
struct Bars {
  const char* clip;
  double white_mm;
  double measured_mm;
  double fitted_white_mm;  // the performer has the rig's proportions already: fitting can only harm
  double fitted_measured_mm;
};

class BvhAccuracyTest : public ::testing::TestWithParam<Bars> {
 protected:
  static void Check(const DetectionNoise& noise, double bar_mm, double fitted_bar_mm) {
    const Skeleton actor = ActorSkeleton();
    double start_mm = 0;
    double given_mm = 0;
    double fitted_mm = 0;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const SyntheticClip clip = PerformBvh(actor, GetParam().clip, noise, seed);
      PoseOptions options = testing::PlainOptions();
      const ClipEvidence evidence(actor, clip.camera, clip.detections.detections2d,
                                  &clip.detections.detections3d, kFps, options);
      const double start = FrameErrors(clip, actor, InitializeFrames(evidence).poses).mean();
      const double given = FrameErrors(clip, actor, testing::Estimate(clip, options).poses).mean();
      options.fit_proportions = true;
      const PoseTrack track = testing::Estimate(clip, options);
      const double fitted =
          FrameErrors(clip, ScaledSkeleton(actor, track.proportions), track.poses).mean();
      EXPECT_LE(given, start) << "seed " << seed;
      EXPECT_LE(fitted, start) << "seed " << seed;
      start_mm += start / kSeeds;
      given_mm += given / kSeeds;
      fitted_mm += fitted / kSeeds;
    }
    std::printf(
        "%s: %.1f mm per frame, %.1f mm batch (bar %.0f), %.1f mm proportions fitted (bar %.0f)\n",
        GetParam().clip, start_mm, given_mm, bar_mm, fitted_mm, fitted_bar_mm);
    EXPECT_LE(given_mm, bar_mm);
    EXPECT_LE(fitted_mm, fitted_bar_mm);
  }
};

TEST_P(BvhAccuracyTest, WhiteNoise) {
  MPC_REQUIRE_DATA();
  Check(DetectionNoise::White(5, 60, 0.1, 0.2), GetParam().white_mm, GetParam().fitted_white_mm);
}

TEST_P(BvhAccuracyTest, MeasuredErrors) {
  MPC_REQUIRE_DATA();
  Check(DetectionNoise::Measured(), GetParam().measured_mm, GetParam().fitted_measured_mm);
}

INSTANTIATE_TEST_SUITE_P(Mocap, BvhAccuracyTest,
                         ::testing::Values(Bars{"cmu_02_01_walk", 20, 50, 20, 50},
                                           Bars{"cmu_02_04_jump_balance", 20, 50, 20, 50},
                                           Bars{"cmu_02_05_punch_strike", 20, 50, 20, 50},
                                           Bars{"animateddrawings_jesse_dance", 22, 50, 22.5, 50},
                                           Bars{"deepmimic_kick", 28.5, 50, 29, 50},
                                           Bars{"deepmimic_roll", 28, 50, 28.5, 50}),
                         [](const auto& test) { return std::string(test.param.clip); });

}  // namespace
}  // namespace mpc
