#include "place.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "mesh_parts.h"
#include "mpc/core/error.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kLampDistanceM = 400;  // outside of everything that casts shadows

Material Made(const cv::Mat& picture, double repeat_m = 0) {
  return {std::make_shared<const Texture>(picture), repeat_m};
}

// Builds a place piece by piece.
class Builder {
 public:
  Builder(const SceneOptions& options, const StageBounds& stage)
      : options_(options), stage_(stage), dice_(options.seed * 7919 + 17) {}

  Place Build() {
    switch (options_.place) {
      case PlaceKind::kRoom:
        Room();
        break;
      case PlaceKind::kStreet:
        Street();
        break;
      case PlaceKind::kPark:
        Park();
        break;
    }
    if (options_.occluders) Occluders();
    if (stage_.stool) SeatedOn(*stage_.stool);
    return std::move(place_);
  }

 private:
  // Half of what the camera sees at a depth behind the actor, on either side.
  double HalfView(double z) const {
    return (stage_.camera.max().z() - z) * std::tan(stage_.half_fov_rad);
  }
  double MiddleX() const { return stage_.camera.center().x(); }

  void Stand(LitMesh mesh, bool casts) {
    if (casts) place_.casts.push_back(place_.standing.size());
    place_.standing.push_back(std::move(mesh));
  }

  void Floor(double x0, double x1, double z0, double z1, const Material& material) {
    LitMesh floor = Quad({x0, 0, z1}, {x1 - x0, 0, 0}, {0, 0, z0 - z1}, material);
    floor.is_floor = true;
    Stand(std::move(floor), false);
  }

  // From the camera's side, so that the front of the actor is lit.
  void Lamp(double least_elevation, double most_elevation, double warmth, double sun, double sky) {
    const double elevation = dice_.Between(least_elevation, most_elevation);
    const double azimuth = dice_.Between(0.25, 1.1) * (dice_.Chance(0.5) ? 1 : -1);
    const Vector3d direction(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                             std::cos(azimuth) * std::cos(elevation));
    Lighting& light = place_.lighting;
    const double reach = (stage_.actor.max() - stage_.actor.min()).norm();
    light.lamp_in_world = stage_.actor.center() + (kLampDistanceM + 4 * reach) * direction;
    const auto w = static_cast<float>(warmth);
    light.lamp_bgr = static_cast<float>(sun) * Eigen::Array3f(1 - w, 1 - 0.4f * w, 1);
    light.sky_bgr = static_cast<float>(sky) * Eigen::Array3f(1, 1 - 0.3f * w, 1 - 0.6f * w);
    light.ground_bgr = 0.45f * light.sky_bgr;
  }

  void RollingBall(double z, double half_reach) {
    const double radius = dice_.Between(0.11, 0.28);
    Mover ball;
    const Vector3d centre(MiddleX(), radius, z);
    ball.body = Ball(centre, radius, Made(BallTexture(&dice_)));
    ball.pivot = centre;
    ball.travel = {half_reach, 0, 0};
    ball.axis = -Vector3d::UnitZ();
    ball.spin_rad = half_reach / radius;
    ball.omega = dice_.Between(0.9, 1.5);
    ball.phase = dice_.Between(0, 2 * std::numbers::pi);
    place_.movers.push_back(std::move(ball));
  }

  // Something on a rope of `length` from (x, top, z).
  void Pendulum(double x, double top, double z, double length, LitMesh weight) {
    Mover swing;
    weight.normals.resize(3, 0);
    swing.body = Merged({std::move(weight), Box({x - 0.012, top - length, z - 0.012},
                                                {x + 0.012, top, z + 0.012}, {nullptr, 0})});
    swing.pivot = {x, top, z};
    swing.spin_rad = dice_.Between(0.25, 0.5);
    swing.omega = std::sqrt(9.81 / length);
    swing.phase = dice_.Between(0, 2 * std::numbers::pi);
    place_.movers.push_back(std::move(swing));
  }

  void Room() {
    const Eigen::AlignedBox3d& actor = stage_.actor;
    const Eigen::AlignedBox3d& eye = stage_.camera;
    const double back = actor.min().z() - dice_.Between(1.3, 2.6);
    const double front = eye.max().z() + 1.0;
    const double left = std::min(actor.min().x(), eye.min().x()) - dice_.Between(1.2, 2.8);
    const double right = std::max(actor.max().x(), eye.max().x()) + dice_.Between(1.2, 2.8);
    const double top = std::max({2.7, actor.max().y() + 0.4, eye.max().y() + 0.4});
    Floor(left, right, back, front,
          Made(dice_.Chance(0.7) ? PlanksTexture(&dice_) : TilesTexture(&dice_), 2));
    const int wall_kind = dice_.Below(3);
    const Material wall = wall_kind == 0   ? Made(BricksTexture(&dice_), 2)
                          : wall_kind == 1 ? Made(WallpaperTexture(&dice_), 2)
                                           : Made(PlasterTexture(&dice_), 3);
    const Material side = Made(PlasterTexture(&dice_), 3);
    const Vector3d up(0, top, 0);
    Stand(Quad({left, 0, back}, {right - left, 0, 0}, up, wall), false);
    Stand(Quad({left, 0, front}, {0, 0, back - front}, up, side), false);
    Stand(Quad({right, 0, back}, {0, 0, front - back}, up, side), false);
    Stand(Quad({right, 0, front}, {left - right, 0, 0}, up, side), false);
    Stand(Quad({left, top, back}, {right - left, 0, 0}, {0, 0, front - back},
               Made(PlasterTexture(&dice_), 3)),
          false);
    const Material board = Made(PlasterTexture(&dice_), 1);
    Stand(Box({left, 0, back}, {right, 0.11, back + 0.02}, board), false);
    Rug(back);
    BackWall(left, right, back, top);
    SideFurniture(left, right, back);
    if (options_.moving_background) {
      const double z = back + 0.75;
      const double x =
          MiddleX() + dice_.Between(0.35, 0.6) * HalfView(z) * (dice_.Chance(0.5) ? 1 : -1);
      const double length = dice_.Between(0.45, 0.6) * top;
      const Material shade = Made(BallTexture(&dice_));
      Pendulum(std::clamp(x, left + 0.8, right - 0.8), top, z, length,
               Ball({std::clamp(x, left + 0.8, right - 0.8), top - length, z},
                    dice_.Between(0.13, 0.2), shade));
      RollingBall(actor.min().z() - 0.35, std::min(0.45 * (right - left), 0.6 * HalfView(z)));
    }
    Lamp(0.8, 1.1, 0.25, 0.62, 0.5);
  }

  void Rug(double back) {
    if (!dice_.Chance(0.6)) return;
    const Vector3d middle = stage_.actor.center();
    const double half_x = dice_.Between(1.0, 1.5), half_z = dice_.Between(0.8, 1.1);
    const double z = std::max(middle.z(), back + half_z + 0.2);
    LitMesh rug = Quad({middle.x() - half_x, 0.004, z + half_z}, {2 * half_x, 0, 0},
                       {0, 0, -2 * half_z}, Made(FabricTexture(&dice_), 0.8));
    rug.is_floor = true;
    Stand(std::move(rug), false);
  }

  // Pictures and furniture along the back wall.
  void BackWall(double left, double right, double back, double top) {
    double x = left + dice_.Between(0.1, 0.5);
    while (x < right - 0.6) {
      const double width = std::min(dice_.Between(0.7, 1.5), right - 0.1 - x);
      switch (dice_.Below(4)) {
        case 0: {  // a shelf of books
          const double height = std::min(dice_.Between(1.6, 2.2), top - 0.2);
          Stand(Box({x, 0, back}, {x + width, height, back + 0.32}, Made(BooksTexture(&dice_))),
                true);
          break;
        }
        case 1: {  // a cabinet with a picture above
          const double height = dice_.Between(0.7, 1.0);
          Stand(Box({x, 0, back}, {x + width, height, back + 0.42}, Made(PlanksTexture(&dice_), 2)),
                true);
          Painting(x + 0.15, height + 0.25, back, 0.7 * width);
          break;
        }
        case 2:
          Sofa(x, back, width);
          Painting(x + 0.1, 1.35, back, 0.6);
          break;
        default:
          Painting(x, dice_.Between(1.0, 1.4), back, dice_.Between(0.5, 0.9));
          break;
      }
      x += width + dice_.Between(0.15, 0.7);
    }
  }

  void Painting(double x, double y, double back, double width) {
    Stand(Box({x, y, back}, {x + width, y + 0.7 * width, back + 0.035},
              Made(PaintingTexture(&dice_))),
          true);
  }

  void Sofa(double x, double back, double width) {
    const Material cloth = Made(FabricTexture(&dice_), 0.6);
    Stand(Merged({Box({x, 0.1, back}, {x + width, 0.42, back + 0.8}, cloth),
                  Box({x, 0.1, back}, {x + width, 0.85, back + 0.22}, cloth),
                  Box({x - 0.14, 0.05, back}, {x, 0.6, back + 0.8}, cloth),
                  Box({x + width, 0.05, back}, {x + width + 0.14, 0.6, back + 0.8}, cloth)}),
          true);
  }

  // Boxes along the side walls, beside the actor's path.
  void SideFurniture(double left, double right, double back) {
    for (const double wall : {left, right}) {
      double z = back + dice_.Between(0.9, 1.4);
      for (int i = 0; i < 3; ++i, z += dice_.Between(1.1, 1.8)) {
        if (dice_.Chance(0.35)) continue;
        const double deep = dice_.Between(0.3, 0.45), high = dice_.Between(0.45, 1.7);
        const double x0 = wall == left ? left : right - deep;
        Stand(Box({x0, 0, z}, {x0 + deep, high, z + dice_.Between(0.5, 0.9)},
                  Made(high > 1 ? BooksTexture(&dice_) : PlanksTexture(&dice_), high > 1 ? 0 : 2)),
              true);
      }
    }
  }

  void SkyAndGround(const Material& ground) {
    constexpr double kReach = 150;
    const Vector3d middle = stage_.actor.center();
    Floor(middle.x() - kReach, middle.x() + kReach, middle.z() - kReach, middle.z() + kReach,
          ground);
    Eigen::Matrix2Xd dome(2, 9);
    for (int i = 0; i < 9; ++i) {
      const double elevation = 0.5 * std::numbers::pi * i / 8;
      dome.col(i) << 400 * std::cos(elevation), 400 * std::sin(elevation) - 6;
    }
    LitMesh sky = Turned({middle.x(), 0, middle.z()}, dome, Made(SkyTexture(&dice_)));
    sky.glows = true;
    Stand(std::move(sky), false);
  }

  void Tree(double x, double z, const Material& bark, const Material& leaves) {
    const double height = dice_.Between(1.8, 3.0);
    Eigen::Matrix2Xd trunk(2, 4);
    trunk << 0.24, 0.16, 0.13, 0.08, 0, 0.3, 0.6 * height, height + 0.6;
    Stand(Turned({x, 0, z}, trunk, {bark.texture, 1.5}), true);
    std::vector<LitMesh> crown;
    for (int i = 0; i < 7; ++i) {
      const double around = dice_.Between(0, 2 * std::numbers::pi), out = dice_.Between(0, 1.1);
      crown.push_back(Ball({x + out * std::cos(around), height + dice_.Between(0.4, 2.2),
                            z + out * std::sin(around)},
                           dice_.Between(0.7, 1.2), leaves));
    }
    Stand(Merged(crown), true);
  }

  void Buildings(double z, double least_height, double most_height) {
    double x = MiddleX() - 1.5 * HalfView(z) - 20;
    while (x < MiddleX() + 1.5 * HalfView(z) + 20) {
      const double width = dice_.Between(8, 16);
      Stand(Box({x, 0, z - 10},
                {x + width, dice_.Between(least_height, most_height), z + dice_.Between(-1, 1)},
                Made(FacadeTexture(&dice_), 12)),
            false);
      x += width + (dice_.Chance(0.3) ? dice_.Between(1, 6) : 0);
    }
  }

  void Street() {
    SkyAndGround(Made(PavingTexture(&dice_), 3));
    const double kerb = stage_.actor.min().z() - dice_.Between(3, 4);
    const double far = kerb - 7;
    Stand(Quad({MiddleX() - 100, 0.003, kerb}, {200, 0, 0}, {0, 0, far - kerb},
               Made(PlasterTexture(&dice_), 3)),
          false);
    cv::Mat grey;  // asphalt
    cv::cvtColor(0.45 * PlasterTexture(&dice_), grey, cv::COLOR_BGR2GRAY);
    cv::cvtColor(grey, grey, cv::COLOR_GRAY2BGR);
    place_.standing.back().texture = std::make_shared<const Texture>(grey);
    Buildings(far - dice_.Between(3, 6), 7, 16);
    const Material metal = Made(BarkTexture(&dice_));
    for (int i = -1; i <= 1; ++i) {
      const double x = MiddleX() + i * dice_.Between(4, 6) + dice_.Between(-1, 1);
      Eigen::Matrix2Xd post(2, 3);
      post << 0.07, 0.05, 0.04, 0, 1, 4.5;
      Stand(Turned({x, 0, kerb + 0.5}, post, metal), true);
    }
    const double z = kerb + 0.9;
    for (int i = 0; i < 4; ++i) {
      const double x = MiddleX() + dice_.Between(-0.9, 0.9) * HalfView(z);
      Stand(Box({x, 0, z}, {x + dice_.Between(0.5, 1.4), dice_.Between(0.45, 1.1), z + 0.5},
                Made(dice_.Chance(0.5) ? FabricTexture(&dice_) : PlanksTexture(&dice_), 1)),
            true);
    }
    if (options_.moving_background) Car(kerb - 2.2);
    Lamp(0.7, 1.0, 0.18, 0.95, 0.42);
  }

  void Car(double z) {
    const double x = MiddleX();
    Mover car;
    const Material paint = Made(FabricTexture(&dice_), 3);
    car.body = Merged({Box({x - 2.1, 0.35, z - 0.85}, {x + 2.1, 0.95, z + 0.85}, paint),
                       Box({x - 1.2, 0.95, z - 0.75}, {x + 1.1, 1.45, z + 0.75}, paint),
                       Box({x - 1.6, 0, z - 0.87}, {x - 0.95, 0.6, z + 0.87}, paint),
                       Box({x + 0.95, 0, z - 0.87}, {x + 1.6, 0.6, z + 0.87}, paint)});
    car.travel = {1.2 * HalfView(z) + 2, 0, 0};
    car.omega = dice_.Between(4, 7) / car.travel.x();
    car.phase = dice_.Between(0, 2 * std::numbers::pi);
    place_.movers.push_back(std::move(car));
  }

  void Park() {
    SkyAndGround(Made(GrassTexture(&dice_), 3));
    const Material bark = Made(BarkTexture(&dice_)), leaves = Made(LeavesTexture(&dice_), 1.2);
    const double near = stage_.actor.min().z() - 2.5;
    for (int i = 0; i < 16; ++i) {
      const double z = near - 26 * std::pow(dice_.Between(0, 1), 1.5);
      Tree(MiddleX() + dice_.Between(-1.2, 1.2) * HalfView(z), z, bark, leaves);
    }
    const double hedge = near - 14;
    Stand(
        Box({MiddleX() - 60, 0, hedge - 14}, {MiddleX() + 60, dice_.Between(1.2, 2.4), hedge - 13},
            Made(LeavesTexture(&dice_), 1.5)),
        false);
    Buildings(near - 70, 8, 20);
    const Material wood = Made(PlanksTexture(&dice_), 2);
    const double x = MiddleX() + dice_.Between(-0.6, 0.6) * HalfView(near);
    Stand(Merged({Box({x - 0.8, 0.4, near}, {x + 0.8, 0.46, near + 0.45}, wood),
                  Box({x - 0.8, 0.46, near - 0.05}, {x + 0.8, 0.9, near}, wood),
                  Box({x - 0.7, 0, near}, {x - 0.6, 0.4, near + 0.4}, wood),
                  Box({x + 0.6, 0, near}, {x + 0.7, 0.4, near + 0.4}, wood)}),
          true);
    if (options_.moving_background) {
      RollingBall(near + 1.6, 0.5 * HalfView(near));
      const double z = near - 1.2, side = MiddleX() - dice_.Between(0.3, 0.6) * HalfView(z);
      Pendulum(side, 3, z, 2.4, Ball({side, 0.6, z}, 0.3, Made(BallTexture(&dice_))));
    }
    Lamp(0.6, 1.0, 0.22, 1.0, 0.42);
  }

  void Occluders() {
    const double actor_front = stage_.actor.max().z(), camera_back = stage_.camera.min().z();
    const double gap = camera_back - actor_front;
    if (gap < 0.9) {
      throw Error(ErrorCode::kUnsupported,
                  "occluders need 0.9 m between the actor's and the camera's paths: use another "
                  "camera or a shorter clip");
    }
    const double z = actor_front + std::min(0.35 * gap, 0.5);
    // What is in front of the actor's middle third.
    const double width = stage_.actor.max().x() - stage_.actor.min().x();
    const double x = stage_.actor.center().x() + dice_.Between(-0.17, 0.17) * width;
    Eigen::Matrix2Xd post(2, 2);
    post << 0.035, 0.035, 0, std::max(2.2, stage_.actor.max().y() + 0.2);
    place_.occluders.push_back(Turned({x, 0, z}, post, Made(BarkTexture(&dice_))));
    const double side = dice_.Chance(0.5) ? 0.3 : -0.3;
    const double half = dice_.Between(0.14, 0.24);
    const double box_x = x + side + (side > 0 ? half : -half);
    place_.occluders.push_back(Box({box_x - half, 0, z - 0.2},
                                   {box_x + half, dice_.Between(0.4, 0.65), z + 0.2},
                                   Made(PlanksTexture(&dice_), 1.2)));
  }

  void SeatedOn(const Stool& stool) {
    constexpr double kLegM = 0.035, kBoardM = 0.03, kInsetM = 0.02;
    const Material wood = Made(PlanksTexture(&dice_), 0.7);
    const Vector3d corner(0.5 * stool.side_m, kBoardM, 0.5 * stool.side_m);
    std::vector<LitMesh> parts = {
        Box(stool.top - corner, stool.top + corner.cwiseProduct(Vector3d(1, 0, 1)), wood)};
    const double reach = 0.5 * stool.side_m - kInsetM - 0.5 * kLegM;
    for (const double x : {-reach, reach}) {
      for (const double z : {-reach, reach}) {
        const Vector3d leg(stool.top.x() + x, 0, stool.top.z() + z);
        const Vector3d half(0.5 * kLegM, 0, 0.5 * kLegM);
        parts.push_back(
            Box(leg - half, leg + half + Vector3d(0, stool.top.y() - kBoardM, 0), wood));
      }
    }
    place_.occluders.push_back(Merged(parts));
  }

  const SceneOptions& options_;
  const StageBounds& stage_;
  Dice dice_;
  Place place_;
};

}  // namespace

LitMesh Mover::At(double seconds) const {
  const double phase_sine = std::sin(omega * seconds + phase);
  const Eigen::Matrix3f rotation = ExpSO3(spin_rad * phase_sine * axis).cast<float>();
  const Eigen::Vector3f centre = pivot.cast<float>();
  const Eigen::Vector3f to = (pivot + phase_sine * travel).cast<float>();
  LitMesh moved = body;
  moved.mesh.positions = (rotation * (body.mesh.positions.colwise() - centre)).colwise() + to;
  if (body.normals.cols() > 0) moved.normals = rotation * body.normals;
  return moved;
}

Place MakePlace(const SceneOptions& options, const StageBounds& stage) {
  return Builder(options, stage).Build();
}

}  // namespace mpc
