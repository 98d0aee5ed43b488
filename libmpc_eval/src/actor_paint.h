// Purpose: the colours of a dressed person as a function of the place on the body.
// Frames: as in actor_shape.h. Units: fractions of the height. Colours: BGR, 0 to 255.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>

#include "actor_shape.h"

namespace mpc {

enum class Pattern { kPlain, kStripes, kPlaid, kDots, kPrint };

struct Wardrobe {
  cv::Vec3f skin, hair, iris, lips;
  cv::Vec3f shirt, shirt_second, trousers, shoes, garment, garment_second;
  Pattern shirt_pattern, garment_pattern;
};

// Seed 0 is one fixed choice.
Wardrobe DrawWardrobe(uint64_t seed, double build);

class ActorPaint {
 public:
  ActorPaint(const ActorShape& shape, const Wardrobe& wardrobe, Outfit outfit);

  // On the closed body.
  cv::Vec3b Body(const Eigen::Vector3d& x) const;
  // On the sheet: distance around and down from its upper edge.
  cv::Vec3b Garment(double around, double down, const Eigen::Vector3d& x) const;

 private:
  cv::Vec3f Head(const Eigen::Vector3d& x) const;
  cv::Vec3f Shirt(const Eigen::Vector3d& x) const;
  cv::Vec3f Leg(const Eigen::Vector3d& x) const;

  const ActorShape& shape_;
  Wardrobe colours_;
  Outfit outfit_;
};

}  // namespace mpc
