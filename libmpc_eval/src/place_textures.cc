#include "place_textures.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace mpc {
namespace {

constexpr int kSide = 512;

cv::Vec3f Mix(const cv::Vec3f& a, const cv::Vec3f& b, float t) { return a + t * (b - a); }

// Smooth noise, -1 to 1, that repeats: `columns` x `rows` random values per picture.
cv::Mat Noise(int columns, int rows, Dice* dice) {
  constexpr int kPad = 3;
  cv::Mat grid(rows + 2 * kPad, columns + 2 * kPad, CV_32F);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      grid.at<float>(y + kPad, x + kPad) = static_cast<float>(dice->Between(-1, 1));
    }
  }
  const auto wrap = [](int i, int n) { return (i - kPad + 4 * n) % n + kPad; };
  for (int y = 0; y < grid.rows; ++y) {
    for (int x = 0; x < grid.cols; ++x) {
      grid.at<float>(y, x) = grid.at<float>(wrap(y, rows), wrap(x, columns));
    }
  }
  const int wide = kSide / columns, high = kSide / rows;
  cv::Mat large;
  cv::resize(grid, large, {grid.cols * wide, grid.rows * high}, 0, 0, cv::INTER_CUBIC);
  cv::Mat noise;
  cv::resize(large(cv::Rect(kPad * wide, kPad * high, columns * wide, rows * high)), noise,
             {kSide, kSide}, 0, 0, cv::INTER_LINEAR);
  return noise;
}

// Sum of noises, each finer and weaker than the one before.
cv::Mat Clouds(int columns, int rows, int octaves, Dice* dice) {
  cv::Mat sum = cv::Mat::zeros(kSide, kSide, CV_32F);
  double size = 0.6;
  for (int i = 0; i < octaves; ++i, size *= 0.6) {
    sum += size * Noise(std::min(kSide, columns << i), std::min(kSide, rows << i), dice);
  }
  return sum;
}

// A picture from a function of the pixel.
template <typename Function>
cv::Mat Paint(Function colour) {
  cv::Mat picture(kSide, kSide, CV_8UC3);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const cv::Vec3f c = colour(x, y);
      for (int i = 0; i < 3; ++i) {
        picture.at<cv::Vec3b>(y, x)[i] = cv::saturate_cast<uchar>(c[i]);
      }
    }
  }
  return picture;
}

// Brightness per cell of a pattern, fixed by the cell's indices.
std::vector<float> CellTones(int count, double spread, Dice* dice) {
  std::vector<float> tones;
  for (int i = 0; i < count; ++i)
    tones.push_back(static_cast<float>(dice->Between(1 - spread, 1 + spread)));
  return tones;
}

// Courses of blocks, every other one shifted by half a block.
cv::Mat Blocks(int columns, int rows, int joint_px, double shift, const cv::Vec3f& block,
               const cv::Vec3f& joint, double spread, Dice* dice) {
  const cv::Mat grain = Clouds(16, 16, 5, dice);
  const std::vector<float> tones = CellTones(columns * rows, spread, dice);
  const int wide = kSide / columns, high = kSide / rows;
  return Paint([&](int x, int y) {
    const int row = y / high;
    const int along = (x + (row % 2 == 1 ? static_cast<int>(shift * wide) : 0)) % kSide;
    const int column = along / wide;
    const bool in_joint = y % high < joint_px || along % wide < joint_px;
    const float tone = tones[static_cast<size_t>(row * columns + column)];
    const float light = 1 + 0.12f * grain.at<float>(y, x);
    return light * (in_joint ? joint : tone * block);
  });
}

}  // namespace

cv::Vec3f Hsv(double hue, double saturation, double value) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + 6 * hue, 6);
    return static_cast<float>(255 * value *
                              (1 - saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0)));
  };
  return {channel(1), channel(3), channel(5)};
}

cv::Mat PlanksTexture(Dice* dice) {
  const cv::Vec3f wood =
      Hsv(dice->Between(0.06, 0.10), dice->Between(0.35, 0.6), dice->Between(0.45, 0.75));
  const cv::Mat grain = Clouds(4, 128, 3, dice);
  const std::vector<float> tones = CellTones(16, 0.16, dice);
  const std::vector<float> shifts = CellTones(8, 1, dice);
  return Paint([&](int x, int y) {
    const int board = y / 64;
    const int along = (x + static_cast<int>(256 * shifts[static_cast<size_t>(board)])) % kSide;
    const bool gap = y % 64 < 2 || along % 256 < 2;
    const float tone = tones[static_cast<size_t>(2 * board + along / 256)];
    const float light = tone * (1 + 0.22f * grain.at<float>(y, (x + 97 * board) % kSide));
    return (gap ? 0.45f : light) * wood;
  });
}

cv::Mat TilesTexture(Dice* dice) {
  const cv::Vec3f tile =
      Hsv(dice->Between(0, 1), dice->Between(0.05, 0.3), dice->Between(0.6, 0.85));
  return Blocks(4, 4, 5, 0, tile, 0.6f * tile, 0.08, dice);
}

cv::Mat BricksTexture(Dice* dice) {
  const cv::Vec3f brick =
      Hsv(dice->Between(0.01, 0.06), dice->Between(0.45, 0.65), dice->Between(0.45, 0.65));
  return Blocks(8, 16, 4, 0.5, brick, Hsv(0.1, 0.1, 0.7), 0.22, dice);
}

cv::Mat PlasterTexture(Dice* dice) {
  const cv::Vec3f paint =
      Hsv(dice->Between(0, 1), dice->Between(0.05, 0.35), dice->Between(0.65, 0.9));
  const cv::Mat stain = Clouds(3, 3, 7, dice);
  return Paint([&](int x, int y) { return (1 + 0.07f * stain.at<float>(y, x)) * paint; });
}

cv::Mat WallpaperTexture(Dice* dice) {
  const double hue = dice->Between(0, 1);
  const cv::Vec3f ground = Hsv(hue, dice->Between(0.1, 0.3), dice->Between(0.7, 0.85));
  const cv::Vec3f figure = Hsv(hue + dice->Between(0, 0.3), dice->Between(0.25, 0.5), 0.6);
  const cv::Mat stain = Clouds(4, 4, 6, dice);
  const bool dots = dice->Chance(0.5);
  return Paint([&](int x, int y) {
    const float u = static_cast<float>(x % 64) - 32;
    const float v = static_cast<float>((y + (x / 64 % 2) * 32) % 64) - 32;
    const bool on = dots ? std::abs(u) + std::abs(v) < 15 : std::abs(u) < 11;
    return (1 + 0.05f * stain.at<float>(y, x)) * (on ? figure : ground);
  });
}

cv::Mat GrassTexture(Dice* dice) {
  const cv::Vec3f dark = Hsv(dice->Between(0.24, 0.30), 0.6, 0.30);
  const cv::Vec3f light = Hsv(dice->Between(0.18, 0.25), 0.55, 0.55);
  const cv::Mat patches = Clouds(4, 4, 4, dice);
  const cv::Mat blades = Clouds(128, 64, 3, dice);
  return Paint([&](int x, int y) {
    const float t = 0.45f + 0.30f * patches.at<float>(y, x) + 0.45f * blades.at<float>(y, x);
    return Mix(dark, light, std::clamp(t, 0.0f, 1.0f));
  });
}

cv::Mat PavingTexture(Dice* dice) {
  const cv::Vec3f stone =
      Hsv(dice->Between(0.05, 0.15), dice->Between(0.03, 0.18), dice->Between(0.45, 0.65));
  return Blocks(4, 8, 4, 0.5, stone, 0.55f * stone, 0.12, dice);
}

cv::Mat FacadeTexture(Dice* dice) {
  const cv::Vec3f wall =
      Hsv(dice->Between(0.02, 0.16), dice->Between(0.1, 0.45), dice->Between(0.5, 0.8));
  const cv::Mat stain = Clouds(8, 8, 6, dice);
  const std::vector<float> tones = CellTones(16, 0.5, dice);
  return Paint([&](int x, int y) -> cv::Vec3f {
    const int u = x % 128, v = y % 128;
    const float light = 1 + 0.10f * stain.at<float>(y, x);
    if (u > 36 && u < 92 && v > 26 && v < 100) {
      const bool frame = u < 41 || u > 87 || v < 31 || v > 95 || (u > 62 && u < 66);
      const cv::Vec3f pane =
          tones[static_cast<size_t>(y / 128 * 4 + x / 128)] *
          Mix(Hsv(0.58, 0.3, 0.5), Hsv(0.58, 0.4, 0.2), static_cast<float>(v) / 128);
      return frame ? Hsv(0.1, 0.05, 0.85) : pane;
    }
    return (v >= 100 && v < 106 && u > 32 && u < 96 ? 0.75f : light) * wall;
  });
}

cv::Mat LeavesTexture(Dice* dice) {
  const cv::Vec3f dark = Hsv(dice->Between(0.25, 0.33), 0.65, 0.16);
  const cv::Vec3f light = Hsv(dice->Between(0.16, 0.27), 0.6, 0.55);
  const cv::Mat leaves = Clouds(24, 24, 4, dice);
  return Paint([&](int x, int y) {
    return Mix(dark, light, std::clamp(0.4f + 0.75f * leaves.at<float>(y, x), 0.0f, 1.0f));
  });
}

cv::Mat BarkTexture(Dice* dice) {
  const cv::Vec3f bark = Hsv(dice->Between(0.05, 0.1), 0.4, 0.35);
  const cv::Mat grain = Clouds(48, 6, 4, dice);
  return Paint([&](int x, int y) { return (1 + 0.45f * grain.at<float>(y, x)) * bark; });
}

cv::Mat FabricTexture(Dice* dice) {
  const double hue = dice->Between(0, 1);
  const cv::Vec3f base = Hsv(hue, dice->Between(0.3, 0.7), dice->Between(0.3, 0.7));
  const cv::Vec3f stripe = Hsv(hue + 0.45, dice->Between(0.1, 0.5), dice->Between(0.5, 0.9));
  const cv::Mat weave = Clouds(128, 128, 2, dice);
  const int period = 32 << dice->Below(3);
  return Paint([&](int x, int y) {
    const float share = 0.5f * static_cast<float>(x % period < period / 4) +
                        0.5f * static_cast<float>(y % period < period / 4);
    return (1 + 0.15f * weave.at<float>(y, x)) * Mix(base, stripe, share);
  });
}

cv::Mat BooksTexture(Dice* dice) {
  cv::Mat shelf(kSide, kSide, CV_8UC3, cv::Scalar(Hsv(0.08, 0.5, 0.22)));
  for (int board = 0; board < 4; ++board) {
    const int bottom = 128 * (board + 1) - 10;
    for (int x = 8; x < kSide - 24;) {
      const int wide = 8 + dice->Below(16), high = 70 + dice->Below(42);
      const cv::Vec3f cover =
          Hsv(dice->Between(0, 1), dice->Between(0.2, 0.8), dice->Between(0.25, 0.85));
      cv::rectangle(shelf, cv::Rect(x, bottom - high, wide, high), cv::Scalar(cover), cv::FILLED);
      cv::rectangle(shelf, cv::Rect(x + 2, bottom - high + 12, wide - 4, 6),
                    cv::Scalar(0.4f * cover + cv::Vec3f(120, 130, 130)), cv::FILLED);
      x += wide + 1 + (dice->Chance(0.08) ? 30 : 0);
    }
    cv::rectangle(shelf, cv::Rect(0, bottom, kSide, 10), cv::Scalar(Hsv(0.08, 0.5, 0.45)),
                  cv::FILLED);
  }
  return shelf;
}

cv::Mat PaintingTexture(Dice* dice) {
  cv::Mat picture(kSide, kSide, CV_8UC3, cv::Scalar(Hsv(dice->Between(0, 1), 0.3, 0.85)));
  for (int i = 0; i < 14; ++i) {
    const cv::Scalar colour(
        Hsv(dice->Between(0, 1), dice->Between(0.3, 0.9), dice->Between(0.2, 0.95)));
    const cv::Point centre(dice->Below(kSide), dice->Below(kSide));
    const cv::Size size(20 + dice->Below(110), 20 + dice->Below(110));
    cv::ellipse(picture, centre, size, dice->Between(0, 180), 0, 360, colour, cv::FILLED,
                cv::LINE_AA);
  }
  cv::rectangle(picture, cv::Rect(0, 0, kSide, kSide), cv::Scalar(Hsv(0.09, 0.5, 0.25)), 36);
  return picture;
}

cv::Mat BallTexture(Dice* dice) {
  const double hue = dice->Between(0, 1);
  const cv::Vec3f a = Hsv(hue, 0.8, 0.85), b = Hsv(hue + 0.5, 0.2, 0.9);
  return Paint([&](int x, int y) { return (x / 64 + y / 128) % 2 == 0 ? a : b; });
}

cv::Mat SkyTexture(Dice* dice) {
  const cv::Vec3f zenith = Hsv(dice->Between(0.57, 0.61), dice->Between(0.4, 0.6), 0.78);
  const cv::Vec3f horizon = Hsv(0.58, 0.10, 0.93);
  const cv::Mat clouds = Clouds(6, 5, 6, dice);
  const auto cover = static_cast<float>(dice->Between(-0.2, 0.3));
  return Paint([&](int x, int y) {
    const float height = 1 - static_cast<float>(y) / kSide;
    const cv::Vec3f clear = Mix(horizon, zenith, std::sqrt(height));
    const float share = std::clamp(1.6f * (clouds.at<float>(y, x) + cover), 0.0f, 1.0f);
    return Mix(clear, {238, 236, 234}, share * std::min(1.0f, 4 * height));
  });
}

}  // namespace mpc
