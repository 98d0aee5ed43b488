// Purpose: from the 33 body landmarks of MediaPipe BlazePose to our joints.
// Source: Bazarevsky et al. 2020; corrections measured against multi-view data (docs/detect.md).
// Units: those of the landmarks. Symbols: J joints.
//
// Hips are moved by 7 % of the torso towards the shoulders, where joint centres are; neck and head
// top are computed from shoulders and ears; the other joints are one landmark as it stands.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "mpc/core/joints.h"

namespace mpc {

inline constexpr int kNumBlazePoseLandmarks = 33;

// The joints that can be had from the landmarks, J of them, in the order of the functions below.
const std::vector<JointId>& BlazePoseJoints();

// positions (2xJ or 3xJ) from landmarks; sized by the callee.
void JointsFromBlazePose(const Eigen::Matrix<double, 2, kNumBlazePoseLandmarks>& landmarks,
                         Eigen::Matrix2Xd* positions);
void JointsFromBlazePose(const Eigen::Matrix<double, 3, kNumBlazePoseLandmarks>& landmarks,
                         Eigen::Matrix3Xd* positions);

// Confidences (J) from those of the landmarks: of several landmarks the least.
Eigen::VectorXd JointConfidencesFromBlazePose(
    const Eigen::Vector<double, kNumBlazePoseLandmarks>& confidences);

}  // namespace mpc
