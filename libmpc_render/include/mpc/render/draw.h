// Purpose: what people look at: mesh, skeleton and detections over a video frame.
// Frames: camera frame. Units: metres, pixels. Images are CV_8UC3 (BGR) of the camera's size.
// Symbols: J joints, V vertices. Sizes of lines and marks grow with the picture.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <span>

#include "mpc/core/camera.h"
#include "mpc/core/detections.h"
#include "mpc/core/joints.h"
#include "mpc/core/triangle_mesh.h"

namespace mpc {

// Stick figure of projected joints (3xJ): left limbs blue, right ones orange, the rest white. Lines whose ends are not in front of the camera, not
// finite or far outside the picture are left out.
void DrawStickFigure(const Camera& camera, std::span<const JointId> joints,
                     const Eigen::Matrix3Xd& joints_in_camera, cv::Mat* image);

// The same of detected joints; those with confidence 0 are left out.
void DrawStickFigure(std::span<const JointId> joints, const Detections2d::Frame& detections,
                     cv::Mat* image);

// A cross per detected joint, the larger and brighter the more confident; none at confidence 0.
void DrawDetections(std::span<const JointId> joints, const Detections2d::Frame& detections,
                    cv::Mat* image);

// The mesh, shaded and see-through, over a video frame.
void DrawMeshOverlay(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                     const Triangles& triangles, cv::Mat* image);

}  // namespace mpc
