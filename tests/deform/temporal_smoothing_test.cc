// Smoothing over time: laws of its weights, clip ends, refused frames, fast motion.
#include "mpc/deform/temporal_smoothing.h"

#include <gtest/gtest.h>

#include <random>

#include "deform/posed_actor.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::Actor;

const SmoothingOptions kMean = SmoothingOptions::Paper();

TEST(SmoothingWeights, AFullWindowIsTheMean) {
  EXPECT_LT((SmoothingWeights({1, 1, 1, 1, 1}, kMean) - VectorXd::Constant(5, 0.2)).norm(), 1e-12);
  const VectorXd quadratic = SmoothingWeights({1, 1, 1, 1, 1}, {.degree = 2});  // Savitzky-Golay
  const VectorXd expected = VectorXd{{-3, 12, 17, 12, -3}} / 35;
  EXPECT_LT((quadratic - expected).norm(), 1e-12);
}

// Whatever is missing: values on a straight line stay there, and what is missing is not looked at.
TEST(SmoothingWeights, ATrendIsKept) {
  for (int missing = 0; missing < 32; ++missing) {
    std::vector<bool> usable;
    for (int i = 0; i < 5; ++i) usable.push_back((missing >> i & 1) == 0);
    const VectorXd weights = SmoothingWeights(usable, kMean);
    for (int i = 0; i < 5; ++i) {
      if (!usable[static_cast<size_t>(i)]) {
        EXPECT_EQ(weights[i], 0);
      }
    }
    const bool both_sides = (usable[0] || usable[1]) && (usable[3] || usable[4]);
    if (usable[2] || both_sides) {
      EXPECT_NEAR(weights.sum(), 1, 1e-12) << missing;
      EXPECT_NEAR(weights.dot(VectorXd::LinSpaced(5, -2, 2)), 0, 1e-12) << missing;
    }
  }
}

TEST(SmoothingWeights, ACorrectionFadesWhereRefinementWasRefused) {
  const auto total = [](const std::vector<bool>& usable) {
    return SmoothingWeights(usable, kMean).sum();
  };
  EXPECT_NEAR(total({1, 1, 0, 0, 0}), 2.0 / 3, 1e-12);
  EXPECT_NEAR(total({1, 0, 0, 0, 0}), 1.0 / 3, 1e-12);
  EXPECT_NEAR(total({0, 0, 0, 1, 1}), 2.0 / 3, 1e-12);
  EXPECT_EQ(total({0, 0, 0, 0, 0}), 0);
}

TEST(SmoothedMiddle, IsThatOfALine) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  VectorXd line(7);
  line << 1, 3, 5, 7, 9, 11, 13;
  EXPECT_NEAR(SmoothedMiddle(line), 7, 1e-12);
  line[0] = line[4] = line[5] = kUnknown;
  EXPECT_NEAR(SmoothedMiddle(line), 7, 1e-12);
  line.head<3>().setConstant(kUnknown);  // beside the end of a clip
  EXPECT_NEAR(SmoothedMiddle(line), 7, 1e-12);
  line[6] = kUnknown;
  EXPECT_EQ(SmoothedMiddle(line), 7);
  line[3] = kUnknown;
  EXPECT_TRUE(std::isnan(SmoothedMiddle(line)));
  VectorXd spike = VectorXd::Zero(7);
  spike[3] = 1;
  const double middle = SmoothedMiddle(spike);
  spike << 1, 0, 0, 0, 0, 0, 0;
  EXPECT_GT(middle, 3 * SmoothedMiddle(spike));
  EXPECT_LT(middle, 0.5);
}

TEST(SmoothingWeights, BadInputIsRefused) {
  EXPECT_MPC_ERROR(SmoothingWeights({1, 1, 1}, kMean), kInvalidArgument, "window of 3");
  EXPECT_MPC_ERROR(SmoothingWeights({1, 1}, {.window_frames = 2, .degree = 3}), kInvalidArgument,
                   "window_frames is 2, expected an odd number; degree is 3");
  EXPECT_MPC_ERROR(SmoothingOptions{.depth_seconds = -1}.Validate(), kInvalidArgument,
                   "depth_seconds is -1");
  EXPECT_EQ(kMean.depth_seconds, 0);  // nothing of ours
}

class SmoothPosesTest : public ::testing::Test {
 protected:
  // Batch poses off by a constant, refined ones off by noise.
  SmoothPosesTest() : truth_(testing::MotionInCamera(MotionKind::kTurn, 1.5, 30)) {
    std::mt19937 rng(4);
    std::normal_distribution<double> normal;
    batch_ = truth_;
    refined_ = truth_;
    for (Eigen::Index f = 0; f < truth_.cols(); ++f) {
      const Eigen::Vector3d turn = 0.05 * Eigen::Vector3d(normal(rng), normal(rng), normal(rng));
      batch_.col(f).segment<3>(3) =
          LogSO3(ExpSO3({0.1, -0.05, 0.08}) * ExpSO3(truth_.col(f).segment<3>(3)));
      refined_.col(f).segment<3>(3) = LogSO3(ExpSO3(turn) * ExpSO3(truth_.col(f).segment<3>(3)));
      for (int n = 0; n < 3; ++n) {
        batch_(n, f) += 0.05;
        refined_(n, f) += 0.02 * normal(rng);
      }
    }
    all_.assign(static_cast<size_t>(truth_.cols()), true);
  }
  MatrixXd Smooth(const std::vector<bool>& is_refined, const SmoothingOptions& options = {}) {
    return SmoothPoses(Actor().skeleton, batch_, refined_, is_refined, options);
  }
  double ErrorMm(const MatrixXd& poses, int begin, int end) const {
    double sum = 0;
    for (int f = begin; f < end; ++f) sum += testing::JointErrorMm(poses.col(f), truth_.col(f));
    return sum / (end - begin);
  }
  int num_frames() const { return static_cast<int>(truth_.cols()); }

  MatrixXd truth_, batch_, refined_;
  std::vector<bool> all_;
};

TEST_F(SmoothPosesTest, NoiseOfTheRefinementGoes) {
  EXPECT_LT(ErrorMm(Smooth(all_), 0, num_frames()), 0.8 * ErrorMm(refined_, 0, num_frames()));
  EXPECT_LT(ErrorMm(Smooth(all_), 0, 2), 1.05 * ErrorMm(refined_, 0, 2));  // a clip's end
}

TEST_F(SmoothPosesTest, OneFrameOfWindowAndNoRefinementChangeNothing) {
  EXPECT_LT((Smooth(all_, {.window_frames = 1}) - refined_).norm(), 1e-9);
  EXPECT_LT((Smooth(std::vector<bool>(all_.size(), false)) - batch_).norm(), 1e-9);
}

TEST_F(SmoothPosesTest, WhatWasRefusedIsNotRead) {
  std::vector<bool> is_refined = all_;
  is_refined[20] = false;
  refined_.col(20).setConstant(std::numeric_limits<double>::quiet_NaN());
  for (const SmoothingOptions& options : {SmoothingOptions(), SmoothingOptions::Paper()}) {
    EXPECT_TRUE(Smooth(is_refined, options).allFinite());
  }
  // Its neighbours' correction holds for it as well.
  EXPECT_LT(ErrorMm(Smooth(is_refined), 20, 21), 0.5 * ErrorMm(batch_, 20, 21));
}

// From refined to refused frames the correction, 87 mm here, ends in steps.
TEST_F(SmoothPosesTest, ThereIsNoJumpWhereRefinementEnds) {
  refined_ = truth_;
  std::vector<bool> is_refined = all_;
  std::fill(is_refined.begin() + 20, is_refined.end(), false);
  const MatrixXd smoothed = Smooth(is_refined);
  const Eigen::Matrix3Xd offset = (smoothed - truth_).topRows<3>();
  for (int f = 0; f + 1 < num_frames(); ++f) {
    EXPECT_LT((offset.col(f + 1) - offset.col(f)).norm(), 0.45 * 0.05 * std::sqrt(3.0)) << f;
  }
  EXPECT_LT(offset.leftCols(18).colwise().norm().maxCoeff(), 0.002);
  EXPECT_EQ(smoothed.rightCols(num_frames() - 22), batch_.rightCols(num_frames() - 22));
}

// A kick-like swing of the knees, 3 Hz at 30 fps. The paper's mean flattens it.
TEST_F(SmoothPosesTest, FastMotionIsNotFlattened) {
  const Skeleton& skeleton = Actor().skeleton;
  for (int f = 0; f < num_frames(); ++f) {
    truth_.col(f) = truth_.col(0);
    for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
      if (skeleton.hinges[h].name.find("knee") == std::string::npos) continue;
      const double middle = (skeleton.hinges[h].min_rad + skeleton.hinges[h].max_rad) / 2;
      truth_(6 + static_cast<int>(h), f) =
          middle + 0.6 * std::sin(2 * std::numbers::pi * 3 * f / 30.0);
    }
  }
  batch_ = refined_ = truth_;
  batch_.row(0).array() += 0.03;
  const double ours = ErrorMm(Smooth(all_), 0, num_frames());
  const double mean = ErrorMm(Smooth(all_, SmoothingOptions::Paper()), 0, num_frames());
  EXPECT_GT(mean, 5);
  EXPECT_LT(ours, 0.15 * mean);
}

TEST_F(SmoothPosesTest, StaysWithinTheBounds) {
  const Skeleton& skeleton = Actor().skeleton;
  batch_ = batch_.cwiseMax(skeleton.LowerBounds().replicate(1, num_frames()));
  refined_.bottomRows(27).colwise() = skeleton.LowerBounds().tail(27);
  for (int f = 0; f < num_frames(); f += 2)
    batch_.col(f).tail(27) = skeleton.UpperBounds().tail(27);
  const MatrixXd smoothed = Smooth(all_);
  for (int f = 0; f < num_frames(); ++f) {
    EXPECT_TRUE((smoothed.col(f).array() >= skeleton.LowerBounds().array()).all());
    EXPECT_TRUE((smoothed.col(f).array() <= skeleton.UpperBounds().array()).all());
  }
}

TEST_F(SmoothPosesTest, BadInputIsRefused) {
  EXPECT_MPC_ERROR(Smooth({true}), kMismatch, "1 flags");
}

TEST_F(SmoothPosesTest, AClipOfOneFrame) {
  const MatrixXd one =
      SmoothPoses(Actor().skeleton, batch_.leftCols(1), refined_.leftCols(1), {true}, {});
  EXPECT_LT((one - refined_.leftCols(1)).norm(), 1e-9);
}

// A shirt that stands off by the same amount from a body that turns.
TEST(SmoothDisplacementsTest, WhatIsFixedToTheBodyStays) {
  const MatrixXd poses = testing::MotionInCamera(MotionKind::kTurn, 1, 30);
  const Eigen::Index num_vertices = Actor().mesh.positions.cols();
  Eigen::Matrix3Xf at_bind(3, num_vertices);
  std::mt19937 rng(2);
  std::normal_distribution<float> normal(0, 0.03f);
  for (float& x : at_bind.reshaped()) x = normal(rng);

  std::vector<Eigen::Matrix3Xf> window;
  KinematicState state;
  for (int f = 10; f < 15; ++f) {
    ForwardKinematics(Actor().skeleton, poses.col(f), &state);
    Eigen::Matrix3Xf displacement = at_bind;
    TurnFromBind(Actor(), state, &displacement);
    EXPECT_GT((displacement - at_bind).norm(), 0.1 * at_bind.norm());
    EXPECT_NEAR(displacement.norm(), at_bind.norm(), 1e-4 * at_bind.norm());
    TurnToBind(Actor(), state, &displacement);
    window.push_back(displacement);
  }
  EXPECT_LT((SmoothDisplacements(window, kMean) - at_bind).norm(), 1e-5 * at_bind.norm());
  window[1].resize(3, 0);
  EXPECT_LT((SmoothDisplacements(window, kMean) - at_bind).norm(), 1e-5 * at_bind.norm());
  for (Eigen::Matrix3Xf& frame : window) frame.resize(3, 0);
  EXPECT_EQ(SmoothDisplacements(window, kMean).cols(), 0);
}

// The axes are those of skinning: moving a vertex at bind or its displacement comes to the same.
TEST(SmoothDisplacementsTest, TurnsAsSkinningDoes) {
  KinematicState state;
  ForwardKinematics(Actor().skeleton, testing::MidWalk(), &state);
  Eigen::Matrix3Xf displacement =
      Eigen::Vector3f(0.01f, 0.02f, -0.03f).replicate(1, Actor().mesh.positions.cols());
  Character moved = Actor();
  moved.mesh.positions += displacement;
  TurnFromBind(Actor(), state, &displacement);
  Eigen::Matrix3Xf before, after;
  SkinCharacter(Actor(), state, &before);
  SkinCharacter(moved, state, &after);
  EXPECT_LT((after - before - displacement).colwise().norm().maxCoeff(), 1e-5);
}

TEST(KeepSeenTest, GoesSidewaysAsFarAsItIsSeen) {
  const Eigen::Matrix3Xf refined = Eigen::Vector3f(0.33f, 0, 3).replicate(1, 3);
  Eigen::Matrix3Xf smoothed = Eigen::Vector3f(0.2f, 0, 2).replicate(1, 3);
  smoothed(0, 2) = 0.22f;  // the same pixel
  // 2 cm off at the smoothed depth: a half of the way for a scale of 2 cm, and half of that.
  KeepSeen(refined, Eigen::Vector3f(3, 0, 3), 0.02, &smoothed);
  EXPECT_NEAR(smoothed(0, 0), 0.205f, 1e-6f);
  EXPECT_NEAR(smoothed(0, 1), 0.2f, 1e-6f);
  EXPECT_NEAR(smoothed(0, 2), 0.22f, 1e-6f);
  EXPECT_TRUE((smoothed.row(2).array() == 2).all());
  EXPECT_MPC_ERROR(KeepSeen(refined, Eigen::Vector2f(1, 1), 0.02, &smoothed), kMismatch,
                   "3 refined ones with 2 weights");
}

TEST(SmoothDisplacementsTest, BadInputIsRefused) {
  std::vector<Eigen::Matrix3Xf> window(5, Eigen::Matrix3Xf::Zero(3, 4));
  window[3].resize(3, 5);
  EXPECT_MPC_ERROR(SmoothDisplacements(window, kMean), kMismatch, "4 and 5");
  EXPECT_MPC_ERROR(SmoothDisplacements({window.data(), 3}, kMean), kInvalidArgument, "window of 3");
  Eigen::Matrix3Xf few(3, 2);
  EXPECT_MPC_ERROR(TurnToBind(Actor(), Actor().bind, &few), kMismatch, "2 displacements");
}

}  // namespace
}  // namespace mpc
