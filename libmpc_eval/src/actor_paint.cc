#include "actor_paint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace mpc {
namespace {

using cv::Vec3f;
using Eigen::Vector3d;

Vec3f Rgb(int hex) {
  return {static_cast<float>(hex & 255), static_cast<float>((hex >> 8) & 255),
          static_cast<float>(hex >> 16)};
}

Vec3f Mix(const Vec3f& a, const Vec3f& b, double t) {
  const auto weight = static_cast<float>(std::clamp(t, 0.0, 1.0));
  return a * (1 - weight) + b * weight;
}

// 0 below `from`, 1 above `to`.
double Ramp(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double Hash(int x, int y, int z) {
  uint32_t h = static_cast<uint32_t>(x) * 0x8da6b343U ^ static_cast<uint32_t>(y) * 0xd8163841U ^
               static_cast<uint32_t>(z) * 0xcb1ab31fU;
  h = (h ^ (h >> 15)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12)) * 0x297a2d39U;
  return (h ^ (h >> 15)) / 4294967296.0;
}

// Smooth noise in [-1, 1] with features of the given size.
double Noise(const Vector3d& x, double size) {
  const Vector3d scaled = x / size;
  const Vector3d base = scaled.array().floor();
  const Vector3d t = (scaled - base).unaryExpr([](double s) { return s * s * (3 - 2 * s); });
  const Eigen::Vector3i i = base.cast<int>();
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1, dy = (corner >> 1) & 1, dz = corner >> 2;
    sum += (dx ? t.x() : 1 - t.x()) * (dy ? t.y() : 1 - t.y()) * (dz ? t.z() : 1 - t.z()) *
           Hash(i.x() + dx, i.y() + dy, i.z() + dz);
  }
  return 2 * sum - 1;
}

// Weave and dirt.
Vec3f Fabric(const Vec3f& colour, const Vector3d& x) {
  const double shade = 1 + 0.05 * Noise(x, 0.035) + 0.05 * Noise(x, 0.004);
  return colour * static_cast<float>(shade);
}

bool Band(double x, double period, double width) {
  return x - period * std::floor(x / period) < width;
}

// A pattern on cloth laid flat; s around, t down.
Vec3f Patterned(Pattern pattern, const Vec3f& first, const Vec3f& second, double s, double t) {
  switch (pattern) {
    case Pattern::kStripes:
      return Band(t, 0.034, 0.014) ? second : first;
    case Pattern::kPlaid: {
      Vec3f colour = first;
      if (Band(s, 0.048, 0.017)) colour = Mix(colour, second, 0.55);
      if (Band(t, 0.048, 0.017)) colour = Mix(colour, second, 0.55);
      if (Band(s - 0.031, 0.048, 0.0025) || Band(t - 0.031, 0.048, 0.0025)) {
        colour = Mix(colour, {235, 235, 235}, 0.6);
      }
      return colour;
    }
    case Pattern::kDots: {
      const double row = std::floor(t / 0.022);
      const double ds = std::remainder(s - 0.011 * row, 0.022);
      const double dt = t - 0.022 * (row + 0.5);
      return std::hypot(ds, dt) < 0.0055 ? second : first;
    }
    case Pattern::kPlain:
    case Pattern::kPrint:
      break;
  }
  return first;
}

}  // namespace

Wardrobe DrawWardrobe(uint64_t seed, double build) {
  static constexpr std::array<int, 6> kSkin = {0xe8b894, 0xd9a27c, 0xf0c8a8,
                                               0xb57c55, 0x8a5a3c, 0xc98f68};
  static constexpr std::array<int, 6> kHair = {0x2c1d14, 0x4a2f1b, 0x17120f,
                                               0x7a5230, 0x9c7442, 0x3a2418};
  static constexpr std::array<int, 4> kIris = {0x4a3020, 0x3e5a78, 0x4c6640, 0x2a1c14};
  // Pairs that stand off from each other.
  static constexpr std::array<std::array<int, 2>, 8> kTops = {{{0xb03030, 0x28304a},
                                                               {0x2f5f9e, 0xe8e6df},
                                                               {0xe9e4d8, 0x9a3b3b},
                                                               {0x2f7a52, 0xe6d9a8},
                                                               {0xd98a2b, 0x3a2b20},
                                                               {0x6b3f86, 0xe0cfe8},
                                                               {0xd5c14a, 0x2b4a63},
                                                               {0x3aa0a8, 0xf1efe6}}};
  static constexpr std::array<int, 5> kTrousers = {0x2b3a55, 0x54514c, 0x8c7a5c, 0x26262b,
                                                   0x4a5f7d};
  static constexpr std::array<int, 4> kShoes = {0x2a201a, 0x5e3b24, 0xb9b4aa, 0x7a1f24};
  static constexpr std::array<std::array<int, 2>, 5> kGarments = {{{0x7a2b3c, 0xd8b48a},
                                                                   {0x24507a, 0xd9e0e6},
                                                                   {0x5f6b3a, 0xe0d6b0},
                                                                   {0xa87a45, 0x5a3a20},
                                                                   {0x4b4f5a, 0xb04a3a}}};
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15ULL + 1);
  const auto draw = [&](size_t n, size_t otherwise) {
    const size_t i = random() % n;
    return seed == 0 ? otherwise : i;
  };
  Wardrobe w;
  w.skin = Rgb(kSkin[draw(kSkin.size(), 1)]);
  w.hair = Rgb(kHair[draw(kHair.size(), 1)]);
  w.iris = Rgb(kIris[draw(kIris.size(), 1)]);
  w.lips = Mix(w.skin, Rgb(0xb0403f), build > 0.5 ? 0.65 : 0.4);
  const auto& top = kTops[draw(kTops.size(), 0)];
  w.shirt = Rgb(top[0]);
  w.shirt_second = Rgb(top[1]);
  w.trousers = Rgb(kTrousers[draw(kTrousers.size(), 4)]);
  w.shoes = Rgb(kShoes[draw(kShoes.size(), 1)]);
  const auto& garment = kGarments[draw(kGarments.size(), 1)];
  w.garment = Rgb(garment[0]);
  w.garment_second = Rgb(garment[1]);
  static constexpr std::array<Pattern, 5> kPatterns = {
      Pattern::kPlaid, Pattern::kStripes, Pattern::kPrint, Pattern::kDots, Pattern::kPlain};
  w.shirt_pattern = kPatterns[draw(kPatterns.size(), 0)];
  w.garment_pattern = kPatterns[draw(2, 1) == 0 ? 0 : 3];
  return w;
}

ActorPaint::ActorPaint(const ActorShape& shape, const Wardrobe& wardrobe, Outfit outfit)
    : shape_(shape), colours_(wardrobe), outfit_(outfit) {}

cv::Vec3f ActorPaint::Head(const Vector3d& x) const {
  const Vector3d at = x - shape_.frame().crown;
  if (shape_.IsHair(x)) {
    const double strand = Noise({3 * std::atan2(x.x(), x.z()), 0.15 * x.y(), 0}, 0.05);
    return colours_.hair * static_cast<float>(1 + 0.22 * strand + 0.10 * Noise(x, 0.004));
  }
  Vec3f colour = colours_.skin * static_cast<float>(1 + 0.03 * Noise(x, 0.012));
  const double ax = std::abs(at.x());
  if (at.z() < 0.018) {
    // Inside of the ears.
    const double ear = std::hypot((at.y() + 0.076) / 0.010, (at.z() + 0.001) / 0.005);
    return ax > 0.043 ? Mix(colour, colours_.skin * 0.7F, 1 - Ramp(ear, 0.6, 1)) : colour;
  }
  const Vec3f dark = colours_.hair * 0.6F;
  // Blush, shade beside the nose and in the sockets.
  colour = Mix(colour, colours_.lips,
               0.25 * (1 - Ramp(std::hypot(ax - 0.024, at.y() + 0.088), 0.004, 0.016)));
  const double socket = std::hypot((ax - 0.018) / 0.013, (at.y() + 0.061) / 0.009);
  colour = Mix(colour, colours_.skin * 0.72F, 0.6 * (1 - Ramp(socket, 0.5, 1.1)));
  const double side = std::hypot((ax - 0.0085) / 0.003, (at.y() + 0.086) / 0.007);
  colour = Mix(colour, colours_.skin * 0.75F, 0.5 * (1 - Ramp(side, 0.3, 1)));
  if (std::hypot((ax - 0.0042) / 0.0024, (at.y() + 0.0915) / 0.0016) < 1)
    return colours_.skin * 0.35F;
  // Eyes.
  const double ex = ax - 0.0182, ey = at.y() + 0.0635;
  const double lid = 0.0040 * std::sqrt(std::max(0.0, 1 - ex * ex / (0.0088 * 0.0088)));
  if (std::abs(ex) < 0.0088 && ey < lid && ey > -0.8 * lid) {
    const double r = std::hypot(ex, ey);
    if (std::hypot(ex - 0.0012, ey - 0.0012) < 0.0008) return {250, 250, 250};
    if (r < 0.0017) return {15, 12, 12};
    if (r < 0.0038) return colours_.iris;
    return {228, 232, 236};
  }
  if (std::abs(ex) < 0.0098 && ey >= lid && ey < lid + 0.0016) return dark * 0.5F;
  if (std::abs(ex) < 0.0088 && ey <= -0.8 * lid && ey > -0.8 * lid - 0.0006)
    return colours_.skin * 0.6F;
  // Brows: an arc that thins outwards.
  const double bx = (ax - 0.0185) / 0.0135;
  const double by = at.y() + 0.0515 + 0.0025 * bx * bx;
  if (std::abs(bx) < 1 && std::abs(by) < 0.0026 - 0.0009 * bx) return Mix(colour, dark, 0.85);
  // Mouth.
  const double mx = at.x() / 0.0150;
  const double my = at.y() + 0.1035;
  if (std::abs(mx) < 1) {
    const double full = 1 - mx * mx;
    if (std::abs(my - 0.0010 * mx * mx) < 0.0007) return colours_.lips * 0.45F;
    if (my > -0.0052 * full && my < 0.0036 * full) return colours_.lips;
  }
  return colour;
}

cv::Vec3f ActorPaint::Shirt(const Vector3d& x) const {
  const BodyFrame& f = shape_.frame();
  const double ax = std::abs(x.x());
  const bool coat = outfit_ == Outfit::kCoat;
  const Vec3f first = coat ? colours_.garment : colours_.shirt;
  const Vec3f second = coat ? colours_.garment_second : colours_.shirt_second;
  const Pattern pattern = coat ? Pattern::kPlain : colours_.shirt_pattern;
  const bool sleeve = ax > f.shoulder.x() + 0.02;
  Vec3f colour;
  if (sleeve) {
    const double around = 0.035 * std::atan2(x.z(), x.y() - f.shoulder.y());
    colour = Patterned(pattern, first, second, around, ax);
    if (ax > shape_.cuff_x() - 0.006) colour = Mix(first, second, 0.5) * 0.8F;
  } else {
    const double around = x.x() - 0.7 * x.z() * std::clamp(x.x() / 0.06, -1.0, 1.0);
    colour = Patterned(pattern, first, second, around, f.neck.y() - x.y());
    if (x.z() > 0 && pattern == Pattern::kPrint) {
      const double r = std::hypot(x.x(), x.y() - 0.66 * f.neck.y());
      const double angle = std::atan2(x.x(), x.y() - 0.66 * f.neck.y());
      if (r < 0.040 * (0.75 + 0.25 * std::cos(5 * angle))) colour = second;
      if (std::abs(r - 0.047) < 0.0035) colour = second;
    }
    if (!coat && x.y() < shape_.hem_y() + 0.005) colour = colour * 0.75F;
    if (coat && x.z() > 0) {
      // A shirt shows between the lapels.
      const double open = 0.012 + 0.16 * std::max(0.0, x.y() - 0.13);
      if (ax < open) {
        colour =
            Patterned(colours_.shirt_pattern, colours_.shirt, colours_.shirt_second, x.x(), x.y());
      } else if (ax < open + 0.016) {
        colour = colour * 0.7F;
      }
    }
  }
  return Fabric(colour, x);
}

cv::Vec3f ActorPaint::Leg(const Vector3d& x) const {
  const BodyFrame& f = shape_.frame();
  const double ax = std::abs(x.x());
  if (x.y() < shape_.shoe_y()) {
    const double sole = x.y() + f.hips_height;
    if (sole < 0.008) return {205, 210, 212};
    Vec3f colour = colours_.shoes;
    // Laces.
    const double along = x.z() - f.ankle.z();
    if (along > 0.018 && along < 0.066 && std::abs(ax - f.hip.x()) < 0.010 && sole > 0.018) {
      colour = Band(along, 0.010, 0.004) ? Vec3f(225, 225, 225) : colour * 0.7F;
    }
    return Fabric(colour, x);
  }
  if (x.y() < shape_.trouser_y()) {
    const bool bare = outfit_ == Outfit::kSkirt;
    if (bare && x.y() > f.ankle.y() + 0.03)
      return colours_.skin * static_cast<float>(1 + 0.03 * Noise(x, 0.02));
    return Fabric({210, 208, 205}, x);  // socks
  }
  Vec3f colour = colours_.trousers;
  if (outfit_ == Outfit::kSkirt) return Fabric(colours_.garment * 0.6F, x);
  if (std::abs(x.y() - shape_.waist_y()) < 0.010 && outfit_ == Outfit::kTight) {
    const bool buckle = ax < 0.012 && x.z() > 0;
    return buckle ? Vec3f(120, 190, 205) : Vec3f(28, 34, 42);
  }
  // Side seams, fly, pockets, worn thighs.
  const bool side = ax > f.hip.x() && std::abs(x.z()) < 0.0016;
  const bool pocket = x.z() > 0 && x.y() > -0.03 &&
                      std::abs(x.y() - 0.02 + 0.8 * (ax - 0.05)) < 0.0014 && ax > 0.045;
  const bool fly = x.z() > 0 && ax < 0.0012 && x.y() > -0.05;
  const bool knee_seam = std::abs(x.y() - shape_.trouser_y() - 0.012) < 0.0012;
  if (side || pocket || fly || knee_seam) colour = colour * 0.6F;
  const double worn = (x.z() > 0 ? 1 : 0.4) * (1 - Ramp(std::abs(x.y() + 0.15), 0.02, 0.14));
  colour = Mix(colour, {200, 195, 185}, 0.22 * worn);
  return Fabric(colour, x);
}

cv::Vec3b ActorPaint::Body(const Vector3d& x) const {
  const BodyFrame& f = shape_.frame();
  const double ax = std::abs(x.x());
  Vec3f colour;
  // A round neckline.
  const double neckline =
      (x - f.neck - Vector3d(0, 0.006, -0.002)).cwiseQuotient(Vector3d(0.050, 0.030, 0.056)).norm();
  const bool above = ax < 0.062 && x.y() > f.neck.y() + 0.016;
  if (ax > shape_.cuff_x()) {
    // Hands: darker between the fingers.
    const double along = ax - f.wrist.x();
    colour = colours_.skin * static_cast<float>(1 + 0.04 * Noise(x, 0.015));
    if (along > 0.052 && Band(x.z() + 0.0005, 0.0092, 0.0014)) colour = colour * 0.72F;
  } else if (above) {
    colour = Head(x);
  } else if (neckline < 1.07) {
    colour = colours_.skin * static_cast<float>(1 + 0.03 * Noise(x, 0.012));
    if (neckline > 0.97)
      colour = (outfit_ == Outfit::kCoat ? colours_.garment : colours_.shirt) * 0.6F;
  } else if (x.y() > shape_.hem_y() - (outfit_ == Outfit::kCasual ? 0.004 : 0)) {
    colour = Shirt(x);
  } else {
    colour = Leg(x);
  }
  return colour;
}

cv::Vec3b ActorPaint::Garment(double around, double down, const Vector3d& x) const {
  const bool coat = outfit_ == Outfit::kCoat;
  Vec3f colour = Patterned(coat ? Pattern::kPlain : colours_.garment_pattern, colours_.garment,
                           colours_.garment_second, around, down);
  if (down < 0.014) colour = coat ? Vec3f(28, 34, 42) : colour * 0.6F;
  return Fabric(colour, x);
}

}  // namespace mpc
