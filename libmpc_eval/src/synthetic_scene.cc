#include "mpc/eval/synthetic_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <vector>

#include "actor_surface.h"
#include "mesh_parts.h"
#include "mpc/core/error.h"
#include "mpc/render/lit_scene.h"
#include "mpc/render/raster.h"
#include "place.h"
#include "sensor_noise.h"

namespace mpc {
namespace {

constexpr int kPlaceShadowPx = 1024;
constexpr int kActorShadowPx = 512;
constexpr double kLampRadius = 0.008;  // of its distance: half a degree, a little more than the sun

// The i-th number of a sequence that fills [0, 1) evenly (van der Corput).
double Even(int i, int base) {
  double value = 0, digit = 1.0 / base;
  for (; i > 0; i /= base, digit /= base) value += digit * (i % base);
  return value;
}

// The same around 0, the mean of `count` of them.
double Centred(int i, int count, int base) {
  double mean = 0;
  for (int k = 0; k < count; ++k) mean += Even(k, base) / count;
  return Even(i, base) - mean;
}

// One of the pictures that are averaged.
struct Sample {
  double pixel_x, pixel_y;  // offset inside the pixel, -0.5 to 0.5
  double lamp_x, lamp_y;    // on the lamp, -1 to 1
  double time;              // in shutter times, -0.5 to 0.5
};

// Times in order, each sample in its own cell of the pixel and of the lamp.
Sample MakeSample(int i, int count) {
  Sample sample;
  sample.time = (i + 0.5) / count - 0.5;
  sample.pixel_x = Centred(i, count, 2);
  sample.pixel_y = Centred(i, count, 3);
  const double angle = 2 * std::numbers::pi * (i + 0.25) / count;
  sample.lamp_x = std::cos(angle);
  sample.lamp_y = std::sin(angle);
  return sample;
}

SceneMoment Between(const SceneMoment& a, const SceneMoment& b, double t) {
  SceneMoment moment;
  const auto s = static_cast<float>(t);
  moment.vertices = (1 - s) * a.vertices + s * b.vertices;
  const CameraFromWorld &from = a.camera_from_world, &to = b.camera_from_world;
  const Eigen::Matrix3d turn = to.rotation * from.rotation.transpose();
  moment.camera_from_world.rotation = ExpSO3(t * LogSO3(turn)) * from.rotation;
  // The centre moves on a straight line.
  const Eigen::Vector3d centre =
      (1 - t) * from.Inverse().translation + t * to.Inverse().translation;
  moment.camera_from_world.translation = -(moment.camera_from_world.rotation * centre);
  return moment;
}

// The moment `t` frames after `current`, -0.5 <= t <= 0.5.
SceneMoment Around(const SceneMoment& previous, const SceneMoment& current, const SceneMoment& next,
                   double t) {
  if (t == 0) return current;
  return t < 0 ? Between(current, previous, -t) : Between(current, next, t);
}

constexpr float kShadeMarginM = 0.06f;    // of a shadow around a body, for the lamp's size
constexpr float kContactMarginM = 0.35f;  // of its darkness on the floor
constexpr float kPieceM = 0.25f;          // of a body whose reach is marked

// Draws the convex hull of points of the world onto a mask, a few pixels wider.
void FillHull(const Camera& camera, const Eigen::Matrix3Xf& points, cv::Mat* mask) {
  constexpr double kNearM = 0.01;
  constexpr float kFarPx = 30000;  // as far as OpenCV draws polygons
  std::vector<cv::Point2f> pixels;
  const Eigen::Matrix3Xf in_camera = ToCamera(camera.camera_from_world, points);
  for (const auto& x : in_camera.colwise()) {
    Eigen::Vector2d pixel;
    if (x.z() < kNearM || !Project(camera, x.cast<double>(), &pixel)) {
      mask->setTo(255);
      return;
    }
    for (const float dx : {-3.0f, 3.0f}) {
      for (const float dy : {-3.0f, 3.0f}) {
        pixels.emplace_back(std::clamp(static_cast<float>(pixel.x()) + dx, -kFarPx, kFarPx),
                            std::clamp(static_cast<float>(pixel.y()) + dy, -kFarPx, kFarPx));
      }
    }
  }
  std::vector<cv::Point2f> hull;
  cv::convexHull(pixels, hull);
  cv::fillConvexPoly(*mask, std::vector<cv::Point>(hull.begin(), hull.end()), 255);
}

// Marks the part of the picture that a box can cover or shade: itself and where the lamp throws it
// onto the floor (a shadow on anything else lies on the way there).
void MarkBox(const Camera& camera, const Eigen::Vector3d& lamp, const Eigen::AlignedBox3f& box,
             cv::Mat* mask) {
  Eigen::Matrix3Xf points(3, 16);
  for (Eigen::Index i = 0; i < 8; ++i) {
    points.col(2 * i) = box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(i));
    const Eigen::Vector3d x = points.col(2 * i).cast<double>();
    points.col(2 * i + 1) = (lamp + lamp.y() / (lamp.y() - x.y()) * (x - lamp)).cast<float>();
  }
  FillHull(camera, points, mask);
}

// Marks the part of the picture that a body can cover or shade while it moves past three places, piece
// by piece. Returns the box around all.
Eigen::AlignedBox3f MarkReach(const Camera& camera, const Eigen::Vector3d& lamp,
                              const Triangles& triangles,
                              const std::array<const Eigen::Matrix3Xf*, 3>& times, cv::Mat* mask) {
  std::map<std::array<int, 3>, Eigen::AlignedBox3f> pieces;  // by where their triangles are now
  Eigen::AlignedBox3f all;
  for (const auto& t : triangles.colwise()) {
    const Eigen::Array3f cell = (times[1]->col(t[0]).array() / kPieceM).floor();
    Eigen::AlignedBox3f& piece =
        pieces[{static_cast<int>(cell[0]), static_cast<int>(cell[1]), static_cast<int>(cell[2])}];
    for (const Eigen::Matrix3Xf* positions : times) {
      for (const int v : t) piece.extend(positions->col(v));
    }
  }
  const Eigen::Vector3f margin = Eigen::Vector3f::Constant(kShadeMarginM);
  for (const auto& [cell, piece] : pieces) {
    all.extend(piece);
    MarkBox(camera, lamp, {piece.min() - margin, piece.max() + margin}, mask);
  }
  return all;
}

// Marks the floor beside the actor, which is darker.
void MarkContact(const Camera& camera, const Eigen::AlignedBox3f& actor, cv::Mat* mask) {
  Eigen::Matrix3Xf floor(3, 4);
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3f corner =
        actor.corner(static_cast<Eigen::AlignedBox3f::CornerType>(i % 2 + i / 2 * 4));
    const float dx = i % 2 != 0 ? kContactMarginM : -kContactMarginM;
    const float dz = i / 2 != 0 ? kContactMarginM : -kContactMarginM;
    floor.col(i) << corner.x() + dx, 0, corner.z() + dz;
  }
  FillHull(camera, floor, mask);
}

std::vector<const TriangleMesh*> Bodies(const std::vector<LitMesh>& meshes) {
  std::vector<const TriangleMesh*> bodies;
  bodies.reserve(meshes.size());
  for (const LitMesh& lit : meshes) bodies.push_back(&lit.mesh);
  return bodies;
}

}  // namespace

std::string_view PlaceName(PlaceKind kind) {
  switch (kind) {
    case PlaceKind::kRoom:
      return "room";
    case PlaceKind::kStreet:
      return "street";
    case PlaceKind::kPark:
      return "park";
  }
  return "";
}

void SceneOptions::Validate() const {
  std::string faults;
  const auto check = [&](const char* name, double value, double least, double most) {
    if (value >= least && value <= most) return;
    faults += fmt::format("{}{} is {}, expected {} to {}", faults.empty() ? "" : "; ", name, value,
                          least, most);
  };
  check("shutter", shutter, 0, 1);
  check("samples", samples, 1, 64);
  check("sensor_noise", sensor_noise, 0, 100);
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "synthetic scene: " + faults);
}

struct SyntheticScene::Impl {
  SceneOptions options;
  ActorSurface actor;
  Place place;
  TriangleMesh occluders;
  std::vector<Sample> samples;
  std::vector<Eigen::Vector3d> lamps;    // per sample, world
  std::vector<ShadowMap> place_shadows;  // per sample
  std::optional<Camera> at_rest;
  cv::Mat still;  // with it: the sum of all samples without anything that moves

  Impl(const SceneOptions& scene_options, const StageBounds& stage, const RigAsset& rig,
       const Character& character, const Camera* camera_at_rest)
      : options(scene_options),
        actor(rig, character, scene_options.seed),
        place(MakePlace(scene_options, stage)) {
    if (!place.occluders.empty()) {
      std::vector<LitMesh> plain = place.occluders;
      occluders = Merged(plain).mesh;
    }
    std::vector<const TriangleMesh*> casters = Bodies(place.occluders);
    for (const size_t i : place.casts) casters.push_back(&place.standing[i].mesh);
    const Eigen::Vector3d lamp = place.lighting.lamp_in_world;
    const Eigen::Matrix3d world_from_lamp = CameraFromRay(lamp);
    for (int i = 0; i < options.samples; ++i) {
      samples.push_back(MakeSample(i, options.samples));
      const Eigen::Vector3d offset(samples.back().lamp_x, samples.back().lamp_y, 0);
      lamps.push_back(lamp + kLampRadius * lamp.norm() * (world_from_lamp * offset));
      place_shadows.push_back(MakeShadowMap(lamps.back(), casters, kPlaceShadowPx));
    }
    if (camera_at_rest == nullptr) return;
    at_rest = *camera_at_rest;
    still = cv::Mat::zeros(at_rest->height, at_rest->width, CV_32FC4);
    for (size_t i = 0; i < samples.size(); ++i) {
      AddLitPicture(Shifted(*at_rest, at_rest->camera_from_world, samples[i]), StillScene(i),
                    &still);
    }
  }

  LitScene StillScene(size_t sample) const {
    LitScene scene;
    scene.lighting = place.lighting;
    scene.shadows.push_back(&place_shadows[sample]);
    for (const LitMesh& lit : place.standing) scene.place.push_back(&lit);
    for (const LitMesh& lit : place.occluders) scene.bodies.push_back(&lit);
    return scene;
  }

  static Camera Shifted(const Camera& camera, const CameraFromWorld& place, const Sample& sample) {
    Camera shifted = camera;
    shifted.has_extrinsics = true;
    shifted.camera_from_world = place;
    // A sample at +x inside the pixel sees what the pixel at +x would.
    shifted.cx -= sample.pixel_x;
    shifted.cy -= sample.pixel_y;
    return shifted;
  }

  bool IsAtRest(const Camera& camera, const SceneMoment& moment) const {
    const CameraFromWorld& pose = moment.camera_from_world;
    return at_rest && camera.width == at_rest->width && camera.height == at_rest->height &&
           camera.fx == at_rest->fx && camera.fy == at_rest->fy && camera.cx == at_rest->cx &&
           camera.cy == at_rest->cy && pose.rotation == at_rest->camera_from_world.rotation &&
           pose.translation == at_rest->camera_from_world.translation;
  }

  // 255 where what moves may be seen while the shutter is open.
  cv::Mat MovingPart(const SceneMoment& previous, const SceneMoment& current,
                     const SceneMoment& next, double seconds, double fps) const {
    const Eigen::Vector3d& lamp = place.lighting.lamp_in_world;
    cv::Mat part = cv::Mat::zeros(at_rest->height, at_rest->width, CV_8UC1);
    const Eigen::AlignedBox3f box =
        MarkReach(*at_rest, lamp, actor.triangles(),
                  {&previous.vertices, &current.vertices, &next.vertices}, &part);
    MarkContact(*at_rest, box, &part);
    for (const Mover& mover : place.movers) {
      const auto at = [&](double t) { return mover.At(seconds + t / fps).mesh; };
      const TriangleMesh before = at(-0.5), now = at(0), after = at(0.5);
      MarkReach(*at_rest, lamp, now.triangles,
                {&before.positions, &now.positions, &after.positions}, &part);
    }
    return part;
  }

  // Where `part` says; empty: everywhere.
  void AddSample(const Camera& camera, const SceneMoment& moment, double seconds, size_t i,
                 const cv::Mat& part, cv::Mat* sum) const {
    const std::vector<LitMesh> body = actor.At(moment.vertices);
    std::vector<LitMesh> moving;
    for (const Mover& mover : place.movers) moving.push_back(mover.At(seconds));
    std::vector<ShadowMap> shadows;
    shadows.push_back(MakeShadowMap(lamps[i], Bodies(body), kActorShadowPx));
    for (const LitMesh& mover : moving) {
      const TriangleMesh* one[] = {&mover.mesh};
      shadows.push_back(MakeShadowMap(lamps[i], one, kActorShadowPx / 2));
    }
    const ContactMap contact = MakeContactMap(Bodies(body));

    LitScene scene = StillScene(i);
    scene.contact = &contact;
    for (const ShadowMap& map : shadows) scene.shadows.push_back(&map);
    for (const LitMesh& lit : moving) scene.place.push_back(&lit);
    for (const LitMesh& lit : body) scene.bodies.push_back(&lit);
    scene.part = part;
    AddLitPicture(Shifted(camera, moment.camera_from_world, samples[i]), scene, sum);
  }
};

SyntheticScene::SyntheticScene(const SceneOptions& options, const StageBounds& stage,
                               const RigAsset& rig, const Character& character,
                               const Camera* at_rest) {
  options.Validate();
  impl_ = std::make_unique<Impl>(options, stage, rig, character, at_rest);
}

SyntheticScene::~SyntheticScene() = default;

cv::Mat SyntheticScene::Picture(const Camera& camera, const SceneMoment& previous,
                                const SceneMoment& current, const SceneMoment& next, int frame,
                                double fps) const {
  cv::Mat sum = cv::Mat::zeros(camera.height, camera.width, CV_32FC4);
  cv::Mat part;
  if (impl_->IsAtRest(camera, previous) && impl_->IsAtRest(camera, current) &&
      impl_->IsAtRest(camera, next)) {
    part = impl_->MovingPart(previous, current, next, frame / fps, fps);
    impl_->still.copyTo(sum, part == 0);
  }
  for (size_t i = 0; i < impl_->samples.size(); ++i) {
    const double t = impl_->options.shutter * impl_->samples[i].time;
    impl_->AddSample(camera, Around(previous, current, next, t), (frame + t) / fps, i, part, &sum);
  }
  cv::Mat picture = Developed(sum, impl_->options.samples);
  AddSensorNoise(impl_->options.sensor_noise, impl_->options.seed, frame, &picture);
  return picture;
}

cv::Mat SyntheticScene::Mask(const Camera& camera, const SceneMoment& moment) const {
  Camera there = camera;
  there.camera_from_world = moment.camera_from_world;
  const Eigen::Matrix3Xf actor = ToCamera(moment.camera_from_world, moment.vertices);
  const Triangles& triangles = impl_->actor.triangles();
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  const cv::Rect bounds = ProjectedBounds(there, actor);
  if (bounds.empty()) return mask;
  const Camera crop = CroppedTo(there, bounds);
  RasterBuffers seen, hiding;
  RasterizeMesh(crop, actor, triangles, {}, &seen);
  cv::Mat visible = seen.triangle_id >= 0;
  if (impl_->occluders.triangles.cols() > 0) {
    RasterizeMesh(crop, ToCamera(moment.camera_from_world, impl_->occluders.positions),
                  impl_->occluders.triangles, {}, &hiding);
    visible &= (hiding.triangle_id < 0) | (hiding.depth >= seen.depth);
  }
  visible.copyTo(mask(bounds));
  return mask;
}

const TriangleMesh& SyntheticScene::occluders() const { return impl_->occluders; }

}  // namespace mpc
