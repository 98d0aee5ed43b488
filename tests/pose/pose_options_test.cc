#include "mpc/pose/pose_options.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "support/expect_error.h"

namespace mpc {
namespace {

TEST(PoseOptionsTest, DefaultAndPaperAreValid) {
  EXPECT_NO_THROW(PoseOptions().Validate());
  EXPECT_NO_THROW(PoseOptions::Paper().Validate());
}

TEST(PoseOptionsTest, PaperHasThePapersValuesAndNothingOfOurs) {
  const PoseOptions paper = PoseOptions::Paper();
  EXPECT_EQ(paper.window_frames, 50);
  EXPECT_EQ(paper.overlap_frames, 10);
  EXPECT_EQ(paper.basis_size, 8);
  EXPECT_EQ(paper.weight_smooth, 50);
  EXPECT_EQ(paper.lambda_translation, 1);
  EXPECT_EQ(paper.lambda_rotation, 600);
  EXPECT_EQ(paper.lambda_angles, 600);
  EXPECT_EQ(paper.weight_3d, 0.1);
  EXPECT_EQ(paper.pck_threshold, 0.4);
  EXPECT_FALSE(paper.soft_band);
  EXPECT_FALSE(paper.anisotropic_3d);
  EXPECT_FALSE(paper.pixels_in_mm);
  EXPECT_FALSE(paper.confidence_weights);
  EXPECT_FALSE(paper.test_depth_flips);
  EXPECT_FALSE(paper.hold_standing_feet);
  EXPECT_FALSE(paper.fit_proportions);
  EXPECT_EQ(paper.robust_2d, 0);
  EXPECT_EQ(paper.robust_3d, 0);
  EXPECT_EQ(paper.lasting_discount, 1);
  EXPECT_EQ(paper.weight_rest, 0);
  EXPECT_EQ(paper.robust_rest, 0);
}

TEST(PoseOptionsTest, EveryFaultIsNamed) {
  PoseOptions options;
  options.window_frames = 1;
  options.overlap_frames = 0;
  options.basis_size = -1;
  options.cutoff_hz = 0;
  options.weight_smooth = 0;
  options.lambda_translation = -1;
  options.lambda_rotation = std::numeric_limits<double>::quiet_NaN();
  options.lambda_angles = std::numeric_limits<double>::infinity();
  options.weight_3d = -1;
  options.error_3d_mm = -1;
  options.depth_error_ratio = 0;
  options.robust_2d = -1;
  options.robust_3d = -1;
  options.pck_threshold = -1;
  options.lasting_discount = 0.5;
  options.weight_rest = -1;
  options.robust_rest = -1;
  for (const std::string name :
       {"window_frames", "overlap_frames", "basis_size", "cutoff_hz", "weight_smooth",
        "lambda_translation", "lambda_rotation", "lambda_angles", "weight_3d is", "robust_2d",
        "robust_3d", "pck_threshold", "lasting_discount", "weight_rest", "robust_rest"}) {
    EXPECT_MPC_ERROR(options.Validate(), kInvalidArgument, name);
  }
}

}  // namespace
}  // namespace mpc
