#include "mpc/core/detections.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/expect_error.h"

namespace mpc {
namespace {

template <typename Detections>
Detections TwoFrames(int rows) {
  Detections detections;
  detections.joints = {JointId::kNeck, JointId::kLeftHip, JointId::kNose};
  detections.frames.resize(2);
  for (auto& frame : detections.frames) frame.confidence.setConstant(3, 0.5);
  if constexpr (std::is_same_v<Detections, Detections2d>) {
    for (auto& frame : detections.frames) frame.pixels.setOnes(rows, 3);
  } else {
    for (auto& frame : detections.frames) frame.positions.setOnes(rows, 3);
  }
  return detections;
}

TEST(DetectionsTest, AcceptsGoodOnes) {
  TwoFrames<Detections2d>(2).Validate();
  TwoFrames<Detections3d>(3).Validate();
  Detections2d().Validate();
}

TEST(DetectionsTest, RefusesRepeatedAndUnknownJoints) {
  Detections2d detections = TwoFrames<Detections2d>(2);
  detections.joints[2] = JointId::kNeck;
  EXPECT_MPC_ERROR(detections.Validate(), kInvalidArgument, "neck appears twice");
  detections.joints[2] = static_cast<JointId>(99);
  EXPECT_MPC_ERROR(detections.Validate(), kInvalidArgument, "joint id 99");
}

TEST(DetectionsTest, RefusesWrongSizes) {
  Detections3d detections = TwoFrames<Detections3d>(3);
  detections.frames[1].positions.setOnes(3, 2);
  EXPECT_MPC_ERROR(detections.Validate(), kInvalidArgument, "frame 1 has 2 positions");
  Detections2d flat = TwoFrames<Detections2d>(2);
  flat.frames[0].confidence.setZero(4);
  EXPECT_MPC_ERROR(flat.Validate(), kInvalidArgument, "4 confidences for 3 joints");
  flat = TwoFrames<Detections2d>(2);
  flat.width = -1;
  EXPECT_MPC_ERROR(flat.Validate(), kInvalidArgument, "picture size -1");
}

TEST(DetectionsTest, RefusesBadNumbers) {
  Detections2d detections = TwoFrames<Detections2d>(2);
  detections.frames[1].pixels(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_MPC_ERROR(detections.Validate(), kInvalidArgument, "frame 1, joint left_hip");
  for (const double bad : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    detections = TwoFrames<Detections2d>(2);
    detections.frames[0].confidence[2] = bad;
    EXPECT_MPC_ERROR(detections.Validate(), kInvalidArgument, "frame 0, joint nose: confidence");
  }
}

TEST(DetectionsTest, FindColumn) {
  const std::vector<JointId> joints = TwoFrames<Detections2d>(2).joints;
  EXPECT_EQ(FindColumn(joints, JointId::kLeftHip), 1);
  EXPECT_EQ(FindColumn(joints, JointId::kRightHip), -1);
}

}  // namespace
}  // namespace mpc
