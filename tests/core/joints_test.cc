#include "mpc/core/joints.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace mpc {
namespace {

JointId Joint(int id) { return static_cast<JointId>(id); }

TEST(JointsTest, NamesRoundTrip) {
  std::set<std::string_view> names;
  for (int id = 0; id < kNumJointIds; ++id) {
    names.insert(JointName(Joint(id)));
    EXPECT_EQ(FindJoint(JointName(Joint(id))), Joint(id));
  }
  EXPECT_EQ(names.size(), static_cast<size_t>(kNumJointIds));
  EXPECT_EQ(FindJoint("left_elbow"), JointId::kLeftElbow);
  EXPECT_EQ(FindJoint("right_ear"), JointId::kRightEar);
  EXPECT_EQ(FindJoint("LEFT_ELBOW"), std::nullopt);
  EXPECT_EQ(FindJoint(""), std::nullopt);
}

TEST(JointsTest, MirrorIsAnInvolutionThatSwapsSides) {
  for (int id = 0; id < kNumJointIds; ++id) {
    const JointId mirror = MirrorJoint(Joint(id));
    EXPECT_EQ(MirrorJoint(mirror), Joint(id));
    std::string name(JointName(Joint(id)));
    if (name.starts_with("left_")) {
      EXPECT_EQ(JointName(mirror), "right_" + name.substr(5));
    } else if (!name.starts_with("right_")) {
      EXPECT_EQ(mirror, Joint(id));
    }
  }
}

TEST(JointsTest, ScoredJointsAreTheLimbsBothSides) {
  const std::span<const JointId> scored = ScoredJoints14();
  const std::set<JointId> distinct(scored.begin(), scored.end());
  EXPECT_EQ(distinct.size(), 14u);
  for (const JointId joint : scored) {
    EXPECT_TRUE(distinct.contains(MirrorJoint(joint)));
    EXPECT_NE(MirrorJoint(joint), joint);
    EXPECT_LT(static_cast<int>(joint), kNumPaperJoints);
  }
}

TEST(JointsTest, StickFigureReachesEveryPaperJointAndIsSymmetric) {
  std::set<JointId> reached;
  std::set<std::pair<JointId, JointId>> pairs;
  for (const auto& [a, b] : StickFigure()) {
    reached.insert({a, b});
    pairs.insert(std::minmax(a, b));
  }
  EXPECT_EQ(reached.size(), static_cast<size_t>(kNumPaperJoints));
  for (const auto& [a, b] : pairs) {
    EXPECT_TRUE(pairs.contains(std::minmax({MirrorJoint(a), MirrorJoint(b)})));
  }
}

}  // namespace
}  // namespace mpc
