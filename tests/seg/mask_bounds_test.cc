#include "mpc/seg/mask_bounds.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "random_mask.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

TEST(MaskBounds, AreOpenCvs) {
  cv::RNG rng(3);
  for (int trial = 0; trial < 500; ++trial) {
    const cv::Mat mask = testing::RandomMask(&rng);
    const cv::Rect part(0, 0, (mask.cols + 1) / 2, (mask.rows + 1) / 2);
    ASSERT_EQ(MaskBounds(mask), cv::boundingRect(mask)) << mask;
    ASSERT_EQ(MaskBounds(mask(part)), cv::boundingRect(mask(part))) << mask(part);
  }
  EXPECT_MPC_ERROR(MaskBounds(cv::Mat()), kInvalidArgument, "mask");
}

TEST(MaskBounds, GrowWithinThePicture) {
  EXPECT_EQ(Grown({5, 6, 2, 3}, 4, {100, 50}), cv::Rect(1, 2, 10, 11));
  EXPECT_EQ(Grown({5, 6, 2, 3}, 7, {10, 12}), cv::Rect(0, 0, 10, 12));
}

}  // namespace
}  // namespace mpc
