#include "mpc/render/draw.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "mpc/core/error.h"
#include "mpc/render/shade.h"

namespace mpc {
namespace {

constexpr int kShift = 4;  // OpenCV draws in 1/16 px

// In units of OpenCV's sub-pixels; empty for what cannot be drawn.
std::optional<cv::Point> Drawable(const Eigen::Vector2d& pixel, const cv::Mat& image) {
  const double reach = 4.0 * (image.cols + image.rows);
  if (!(pixel.cwiseAbs().maxCoeff() < reach)) return std::nullopt;
  const double scale = 1 << kShift;
  return cv::Point(static_cast<int>(std::lround(pixel.x() * scale)),
                   static_cast<int>(std::lround(pixel.y() * scale)));
}

cv::Scalar SideColour(JointId joint) {
  const std::string_view name = JointName(joint);
  if (name.starts_with("left_")) return {255, 160, 40};
  if (name.starts_with("right_")) return {40, 120, 255};
  return {240, 240, 240};
}

int Thickness(const cv::Mat& image) {
  return std::max(1, static_cast<int>(std::lround(0.0025 * std::max(image.cols, image.rows))));
}

void CheckColumns(std::span<const JointId> joints, Eigen::Index columns) {
  if (columns != static_cast<Eigen::Index>(joints.size())) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} positions for {} joints", columns, joints.size()));
  }
}

using JointPoints = std::vector<std::optional<cv::Point>>;  // by JointId

void DrawBones(std::span<const JointId> joints, const JointPoints& points, cv::Mat* image) {
  const int thickness = Thickness(*image);
  for (const JointPair& bone : StickFigure()) {
    const std::optional<cv::Point>& a = points[static_cast<size_t>(bone.a)];
    const std::optional<cv::Point>& b = points[static_cast<size_t>(bone.b)];
    if (!a || !b) continue;
    // Lines across the middle, such as the hip line, belong to neither side.
    const bool crosses = MirrorJoint(bone.a) == bone.b;
    const JointId side = crosses ? JointId::kPelvis : bone.b;
    cv::line(*image, *a, *b, SideColour(side), thickness, cv::LINE_AA, kShift);
  }
  for (const JointId joint : joints) {
    const std::optional<cv::Point>& point = points[static_cast<size_t>(joint)];
    if (!point || static_cast<int>(joint) >= kNumPaperJoints) continue;
    cv::circle(*image, *point, (thickness + 1) << kShift, SideColour(joint), cv::FILLED,
               cv::LINE_AA, kShift);
  }
}

}  // namespace

void DrawStickFigure(const Camera& camera, std::span<const JointId> joints,
                     const Eigen::Matrix3Xd& joints_in_camera, cv::Mat* image) {
  CheckColumns(joints, joints_in_camera.cols());
  JointPoints points(kNumJointIds);
  for (size_t j = 0; j < joints.size(); ++j) {
    const Eigen::Vector3d x = joints_in_camera.col(static_cast<Eigen::Index>(j));
    Eigen::Vector2d pixel;
    if (x.allFinite() && Project(camera, x, &pixel)) {
      points[static_cast<size_t>(joints[j])] = Drawable(pixel, *image);
    }
  }
  DrawBones(joints, points, image);
}

void DrawStickFigure(std::span<const JointId> joints, const Detections2d::Frame& detections,
                     cv::Mat* image) {
  CheckColumns(joints, detections.pixels.cols());
  CheckColumns(joints, detections.confidence.size());
  JointPoints points(kNumJointIds);
  for (size_t j = 0; j < joints.size(); ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    if (!(detections.confidence[column] > 0)) continue;
    points[static_cast<size_t>(joints[j])] = Drawable(detections.pixels.col(column), *image);
  }
  DrawBones(joints, points, image);
}

void DrawDetections(std::span<const JointId> joints, const Detections2d::Frame& detections,
                    cv::Mat* image) {
  CheckColumns(joints, detections.pixels.cols());
  CheckColumns(joints, detections.confidence.size());
  const double size_px = 0.008 * std::max(image->cols, image->rows);
  for (size_t j = 0; j < joints.size(); ++j) {
    const auto column = static_cast<Eigen::Index>(j);
    const double confidence = std::clamp(detections.confidence[column], 0.0, 1.0);
    const std::optional<cv::Point> centre = Drawable(detections.pixels.col(column), *image);
    if (!(confidence > 0) || !centre) continue;
    const int arm =
        static_cast<int>(std::lround((0.5 + 0.5 * confidence) * size_px * (1 << kShift)));
    const cv::Scalar colour = SideColour(joints[j]) * (0.4 + 0.6 * confidence);
    for (const cv::Point& step : {cv::Point(arm, arm), cv::Point(arm, -arm)}) {
      cv::line(*image, *centre - step, *centre + step, colour, 1 + Thickness(*image) / 3,
               cv::LINE_AA, kShift);
    }
  }
}

void DrawMeshOverlay(const Camera& camera, const Eigen::Matrix3Xf& positions_in_camera,
                     const Triangles& triangles, cv::Mat* image) {
  constexpr double kOpacity = 0.6;
  MeshAppearance appearance;
  appearance.bgr = {215, 225, 190};
  appearance.ambient = 0.25;
  ShadeMesh(camera, positions_in_camera, triangles, appearance, kOpacity, image);
}

}  // namespace mpc
