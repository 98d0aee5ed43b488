#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "mpc/render/model_mask.h"
#include "mpc/render/raster.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

class SkeletonMaskTest : public ::testing::Test {
 protected:
  cv::Mat Whole() const { return cv::Mat(camera_.height, camera_.width, CV_8UC1, cv::Scalar(255)); }
  Camera camera_ = Camera::FromFov(400, 300, 1);
  const CapsuleSet limbs_ = {{{-0.8, -0.3, 3}, {0.3, 0.1, 3.5}, 0.12, 0.06},
                             {{0.3, 0.1, 3.5}, {0.5, 0.7, 3.2}, 0.06, 0.03}};
};

TEST_F(SkeletonMaskTest, OutlinesEqualTheFineMesh) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> at(-1.5, 1.5), radius(0.01, 0.5);
  camera_.distortion = {-0.1, 0.02, 0, 0, 0};
  for (int round = 0; round < 40; ++round) {
    const CapsuleSet capsule = {{{at(random), at(random), 3 + at(random)},
                                 {at(random), at(random), 3 + at(random)},
                                 radius(random),
                                 radius(random)}};
    RasterBuffers buffers;
    RasterizeCapsules(camera_, capsule, {}, &buffers);
    const cv::Mat fine = buffers.triangle_id >= 0;
    const cv::Mat mask = CapsuleMask(camera_, capsule);
    // Both are polygons within half a percent of the radius: about the rim's own pixels.
    EXPECT_LT(cv::countNonZero(mask != fine), 10 + 0.02 * cv::countNonZero(fine)) << round;
  }
}

TEST_F(SkeletonMaskTest, CapsulesAroundTheNearPlane) {
  const CapsuleSet through = {{{0, 0.3, -1}, {0, 0, 3}, 0.1, 0.1}};
  RasterBuffers buffers;
  RasterizeCapsules(camera_, through, {}, &buffers);
  const cv::Mat fine = buffers.triangle_id >= 0;
  EXPECT_GT(cv::countNonZero(fine), 100);
  EXPECT_EQ(cv::countNonZero(CapsuleMask(camera_, through) != fine), 0);
  EXPECT_EQ(cv::countNonZero(CapsuleMask(camera_, {{{0, 0, -3}, {1, 0, -3}, 0.1, 0.1}})), 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(cv::countNonZero(CapsuleMask(camera_, {{{nan, 0, 3}, {1, 0, 3}, 0.1, 0.1}})), 0);
}

TEST_F(SkeletonMaskTest, LimbsShrinkByTheThickness) {
  const cv::Mat full = SkeletonMask(camera_, limbs_, 1, Whole());
  EXPECT_EQ(cv::countNonZero(full != CapsuleMask(camera_, limbs_)), 0);
  const cv::Mat thin = SkeletonMask(camera_, limbs_, 1.0 / 3, Whole());
  EXPECT_EQ(cv::countNonZero(thin & ~full), 0);
  // Round ends aside, a third of the width is a third of the area.
  EXPECT_NEAR(cv::countNonZero(thin), cv::countNonZero(full) / 3.0, 0.12 * cv::countNonZero(full));
}

TEST_F(SkeletonMaskTest, WithoutThicknessBonesAreUnbrokenLines) {
  const cv::Mat lines = SkeletonMask(camera_, limbs_, 0, Whole());
  for (const Capsule& limb : limbs_) {
    Eigen::Vector2d a, b;
    ASSERT_TRUE(Project(camera_, limb.a, &a) && Project(camera_, limb.b, &b));
    // Every row or column that the bone crosses has one or two of its pixels.
    const bool flat = std::abs(b.x() - a.x()) > std::abs(b.y() - a.y());
    const int along = flat ? 0 : 1;
    const double least = std::min(a[along], b[along]), most = std::max(a[along], b[along]);
    for (int i = static_cast<int>(std::ceil(least)); i <= static_cast<int>(most); ++i) {
      const double s = (i - a[along]) / (b[along] - a[along]);
      const double across = a[1 - along] + s * (b[1 - along] - a[1 - along]);
      int found = 0;
      for (int j = -1; j <= 1; ++j) {
        const int other = static_cast<int>(std::lround(across)) + j;
        found += (flat ? lines.at<uchar>(other, i) : lines.at<uchar>(i, other)) != 0;
      }
      EXPECT_GE(found, 1);
    }
  }
  EXPECT_LT(cv::countNonZero(lines), 600);
}

TEST_F(SkeletonMaskTest, IsClippedToTheModel) {
  cv::Mat model = Whole();
  model.colRange(0, 200).setTo(0);
  const cv::Mat thin = SkeletonMask(camera_, limbs_, 0.5, model);
  EXPECT_GT(cv::countNonZero(thin), 50);
  EXPECT_EQ(cv::countNonZero(thin & ~model), 0);
}

TEST_F(SkeletonMaskTest, MisuseIsRefused) {
  EXPECT_MPC_ERROR(SkeletonMask(camera_, limbs_, -1, Whole()), kInvalidArgument, "-1");
  EXPECT_MPC_ERROR(SkeletonMask(camera_, limbs_, 0, cv::Mat(3, 4, CV_8UC1)), kInvalidArgument,
                   "4 x 3");
  EXPECT_MPC_ERROR(SkeletonMask(camera_, {{{0, 0, 2}, {0, 1, 2}, 0.1, -1}}, 0, Whole()),
                   kInvalidArgument, "-1");
}

}  // namespace
}  // namespace mpc
