#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "mpc/core/error.h"
#include "mpc/eval/metrics.h"
#include "mpc/io/joint_truth_file.h"

namespace monoperfcap {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string estimate;
  std::string truth;
  std::string joints = "14";
  bool json = false;
};

bool Has(const std::vector<mpc::JointId>& joints, mpc::JointId joint) {
  return std::find(joints.begin(), joints.end(), joint) != joints.end();
}

// The joints to score: the 14 of the papers, or all that both files have.
std::vector<mpc::JointId> ScoredJoints(const Arguments& arguments, const mpc::JointTrack& estimate,
                                       const mpc::JointTrack& truth) {
  std::vector<mpc::JointId> joints;
  if (arguments.joints == "14") {
    const auto scored = mpc::ScoredJoints14();
    joints.assign(scored.begin(), scored.end());
  } else {
    joints = estimate.joints;
  }
  std::erase_if(joints, [&](mpc::JointId joint) {
    return !Has(estimate.joints, joint) || !Has(truth.joints, joint);
  });
  if (joints.empty()) {
    throw mpc::Error(mpc::ErrorCode::kMismatch,
                     fmt::format("{} and {} have none of the joints to score in common",
                                 arguments.estimate, arguments.truth));
  }
  return joints;
}

// The limbs, whose lengths no pose changes.
std::vector<mpc::JointPair> Limbs() {
  using mpc::JointId;
  std::vector<mpc::JointPair> limbs = {{JointId::kLeftShoulder, JointId::kLeftElbow},
                                       {JointId::kLeftElbow, JointId::kLeftWrist},
                                       {JointId::kLeftHip, JointId::kLeftKnee},
                                       {JointId::kLeftKnee, JointId::kLeftAnkle},
                                       {JointId::kLeftAnkle, JointId::kLeftToe}};
  for (size_t i = 0; i < 5; ++i) {
    limbs.push_back({mpc::MirrorJoint(limbs[i].a), mpc::MirrorJoint(limbs[i].b)});
  }
  return limbs;
}

// Numbers that do not exist are null.
Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json ToJson(const mpc::AlignedError& error) {
  return {{"mean_mm", Number(error.mean_mm)},
          {"alignment", error.alignment},
          {"frames", error.num_frames},
          {"observations", error.num_observations}};
}

Json ToJson(const mpc::SecondDifference& difference) {
  return {{"mm_per_frame2", Number(difference.mean_mm_per_frame2)},
          {"mm_per_s2", Number(difference.mean_mm_per_s2)}};
}

int Run(const Arguments& arguments) {
  const mpc::JointTrack estimate = mpc::ReadJointTrack(arguments.estimate);
  const mpc::JointTrack truth = mpc::ReadJointTrack(arguments.truth);
  if (estimate.num_frames() != truth.num_frames()) {
    throw mpc::Error(mpc::ErrorCode::kMismatch,
                     fmt::format("{} has {} frames, {} has {}", arguments.estimate,
                                 estimate.num_frames(), arguments.truth, truth.num_frames()));
  }
  const std::vector<mpc::JointId> joints = ScoredJoints(arguments, estimate, truth);
  const Eigen::MatrixXd estimated = mpc::SelectJoints(estimate.positions, estimate.joints, joints);
  const Eigen::MatrixXd expected = mpc::SelectJoints(truth.positions, truth.joints, joints);
  const mpc::JointErrors errors = mpc::CompareJoints(joints, estimated, expected);
  const mpc::SecondDifference jitter = mpc::Jitter(estimated, estimate.fps);
  const mpc::SecondDifference truth_jitter = mpc::Jitter(expected, estimate.fps);
  const mpc::SecondDifference acceleration =
      mpc::AccelerationError(estimated, expected, estimate.fps);
  const mpc::BoneLengthDeviation bones = mpc::CompareBoneLengths(joints, estimated, Limbs());
  std::string names;
  for (const mpc::JointId joint : joints) {
    names += (names.empty() ? "" : " ") + std::string(mpc::JointName(joint));
  }

  if (arguments.json) {
    const Json json = {{"joints", names},
                       {"frames", errors.num_frames},
                       {"missing_observations", errors.num_missing},
                       {"absolute", ToJson(errors.absolute)},
                       {"mpjpe", ToJson(errors.root)},
                       {"n_mpjpe", ToJson(errors.scale)},
                       {"pa_mpjpe", ToJson(errors.similarity)},
                       {"jitter", ToJson(jitter)},
                       {"truth_jitter", ToJson(truth_jitter)},
                       {"acceleration_error", ToJson(acceleration)},
                       {"limb_length_deviation_mm", Number(bones.max_mm)}};
    std::printf("%s\n", json.dump(1).c_str());
    return kExitOk;
  }
  std::printf("%s", mpc::FormatJointErrors(errors).c_str());
  std::printf("%s", fmt::format("jitter    {:7.2f} mm/frame^2 (truth {:.2f}), acceleration error "
                                "{:.2f} mm/frame^2, limb lengths vary by at most {:.2f} mm\n"
                                "joints: {}\n",
                                jitter.mean_mm_per_frame2, truth_jitter.mean_mm_per_frame2,
                                acceleration.mean_mm_per_frame2, bones.max_mm, names)
                        .c_str());
  return kExitOk;
}

}  // namespace

Command AddEvalCommand(CLI::App* parent) {
  CLI::App* const app = parent->add_subcommand("eval", "Compare captured joints with the truth");
  const auto arguments = std::make_shared<Arguments>();
  app->add_option("joints", arguments->estimate, "joints.trc of a capture")->required();
  app->add_option("--truth", arguments->truth, "The truth: .trc, or ground-truth .json")
      ->required();
  app->add_option("--joints", arguments->joints,
                  "14: shoulders, elbows, wrists, hips, knees, ankles, toes; all: what both have")
      ->check(CLI::IsMember({"14", "all"}))
      ->capture_default_str();
  app->add_flag("--json", arguments->json, "Print JSON");
  return {app, [arguments] { return Run(*arguments); }};
}

}  // namespace monoperfcap
