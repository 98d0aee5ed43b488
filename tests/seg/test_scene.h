// Purpose: a person-like figure before a textured background, with exact masks, at any size.
// Units: pixels; the figure is drawn in a unit square and scaled.
#pragma once

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace mpc::testing {

struct TestSceneOptions {
  cv::Size size = {240, 320};
  cv::Point2d centre = {120, 160};  // of the figure
  double height = 240;
  cv::Scalar colour = {60, 70, 190};
  cv::Scalar background = {130, 120, 100};
  bool same_texture = false;    // the figure has the background's colours
  cv::Point2d camera = {0, 0};  // shift of the background
  uint32_t seed = 1;            // of the noise; the texture depends on nothing
};

struct TestScene {
  cv::Mat picture;
  cv::Mat truth;     // the figure
  cv::Mat skeleton;  // thin limbs in its middle
};

// Torso, head, arms and legs; all radii times `thickness`.
inline cv::Mat DrawFigure(const cv::Size& size, const cv::Point2d& centre, double height,
                          double thickness) {
  cv::Mat mask(size, CV_8U, cv::Scalar(0));
  const auto at = [&](double x, double y) {
    return cv::Point(cvRound(centre.x + height * x), cvRound(centre.y + height * y));
  };
  const auto limb = [&](double x0, double y0, double x1, double y1, double radius) {
    cv::line(mask, at(x0, y0), at(x1, y1), 255,
             std::max(1, cvRound(2 * height * radius * thickness)));
  };
  limb(0, -0.22, 0, 0.02, 0.09);
  cv::circle(mask, at(0, -0.42), std::max(1, cvRound(height * 0.07 * thickness)), 255, cv::FILLED);
  limb(0, -0.4, 0, -0.2, 0.03);
  limb(-0.08, -0.25, -0.25, -0.02, 0.035);
  limb(0.08, -0.25, 0.27, -0.12, 0.035);
  limb(-0.05, 0.02, -0.10, 0.45, 0.045);
  limb(0.05, 0.02, 0.12, 0.45, 0.045);
  return mask;
}

inline TestScene MakeScene(const TestSceneOptions& options = {}) {
  TestScene scene;
  scene.truth = DrawFigure(options.size, options.centre, options.height, 1);
  scene.skeleton = DrawFigure(options.size, options.centre, options.height, 0.3);
  // Blotches about a twentieth of the figure wide, on a plane larger than the picture.
  const int margin = 64;
  const double blotch = std::max(2.0, 0.05 * options.height);
  const cv::Size plane(options.size.width + 2 * margin, options.size.height + 2 * margin);
  cv::Mat texture(cvCeil(plane.height / blotch) + 1, cvCeil(plane.width / blotch) + 1, CV_32FC3);
  cv::RNG fixed(7);
  fixed.fill(texture, cv::RNG::NORMAL, 0, 14);
  cv::resize(texture, texture, plane, 0, 0, cv::INTER_CUBIC);
  const auto piece = [&](const cv::Point2d& move) {
    cv::Mat out;
    const cv::Matx23d shift(1, 0, move.x - margin, 0, 1, move.y - margin);
    cv::warpAffine(texture, out, shift, options.size, cv::INTER_LINEAR, cv::BORDER_REFLECT);
    return out;
  };
  cv::Mat picture = piece(options.camera) + options.background;
  if (options.same_texture) {  // another piece of the background, which moves with the figure
    cv::Mat cloth = piece(options.centre - cv::Point2d(options.size) / 2 + cv::Point2d(40, 25));
    cloth += options.background;
    cloth.copyTo(picture, scene.truth);
  } else {
    picture.setTo(options.colour, scene.truth);
  }
  cv::Mat noise(options.size, CV_32FC3);
  cv::RNG(options.seed).fill(noise, cv::RNG::NORMAL, 0, 3);
  picture += noise;
  picture.convertTo(scene.picture, CV_8U);
  return scene;
}

// The same figure drawn a little aside: the model of a pose that is not quite right.
inline cv::Mat WrongModel(const TestSceneOptions& options, double shift_of_height) {
  const cv::Point2d aside(shift_of_height * options.height,
                          -0.5 * shift_of_height * options.height);
  return DrawFigure(options.size, options.centre + aside, options.height, 1);
}

}  // namespace mpc::testing
