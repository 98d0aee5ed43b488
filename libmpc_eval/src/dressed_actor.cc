#include "mpc/eval/dressed_actor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>

#include "actor_paint.h"
#include "actor_shape.h"
#include "cloth_simulator.h"
#include "garment.h"
#include "iso_surface.h"
#include "mpc/core/error.h"
#include "skin_weights.h"
#include "texture_atlas.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr int kTextureSize = 1024;
constexpr double kSettleS = 1;
constexpr double kSettleDamping = 8;  // per second
constexpr double kSettleStepS = 1.0 / 480;

// Points from a to b, both included, about `step` apart.
void AddPlanes(double a, double b, double step, std::vector<double>* planes) {
  const int n = std::max(1, static_cast<int>(std::lround((b - a) / step)));
  for (int i = planes->empty() ? 0 : 1; i <= n; ++i) planes->push_back(a + (b - a) * i / n);
}

// Fine where head, hands and feet are.
std::array<std::vector<double>, 3> GridPlanes(const BodyFrame& f) {
  std::array<std::vector<double>, 3> planes;
  std::vector<double> half;
  AddPlanes(0, 0.13, 0.0098, &half);
  AddPlanes(0.13, f.wrist.x() - 0.01, 0.0145, &half);
  AddPlanes(f.wrist.x() - 0.01, f.fingertip.x() + 0.025, 0.0085, &half);
  for (size_t i = half.size(); i-- > 1;) planes[0].push_back(-half[i]);
  planes[0].insert(planes[0].end(), half.begin(), half.end());
  AddPlanes(-f.hips_height - 0.012, f.ankle.y() + 0.02, 0.0095, &planes[1]);
  AddPlanes(f.ankle.y() + 0.02, -0.03, 0.0145, &planes[1]);
  AddPlanes(-0.03, f.neck.y() + 0.02, 0.0125, &planes[1]);
  AddPlanes(f.neck.y() + 0.02, f.crown.y() + 0.025, 0.0070, &planes[1]);
  AddPlanes(-0.16, -0.085, 0.0125, &planes[2]);
  AddPlanes(-0.085, 0.085, 0.0090, &planes[2]);
  AddPlanes(0.085, 0.17, 0.0105, &planes[2]);
  return planes;
}

// The bones' origins; right ones are mirrored.
struct BonePlan {
  const char* name;
  const char* parent;
  Vector3d origin;
};

std::vector<BonePlan> MakeBones(const BodyFrame& f) {
  const Vector3d clavicle(0.25 * f.shoulder.x(), f.shoulder.y() + 0.004, 0.01);
  std::vector<BonePlan> bones = {{"hips", "", {0, 0, 0}},
                                 {"spine", "hips", f.spine},
                                 {"chest", "spine", f.chest},
                                 {"neck", "chest", f.neck},
                                 {"head", "neck", f.head}};
  const std::array<BonePlan, 8> left = {{{"leftShoulder", "chest", clavicle},
                                         {"leftUpperArm", "leftShoulder", f.shoulder},
                                         {"leftLowerArm", "leftUpperArm", f.elbow},
                                         {"leftHand", "leftLowerArm", f.wrist},
                                         {"leftUpperLeg", "hips", f.hip},
                                         {"leftLowerLeg", "leftUpperLeg", f.knee},
                                         {"leftFoot", "leftLowerLeg", f.ankle},
                                         {"leftToes", "leftFoot", f.ball}}};
  const std::array<BonePlan, 8> right = {{{"rightShoulder", "chest", Mirrored(clavicle)},
                                          {"rightUpperArm", "rightShoulder", Mirrored(f.shoulder)},
                                          {"rightLowerArm", "rightUpperArm", Mirrored(f.elbow)},
                                          {"rightHand", "rightLowerArm", Mirrored(f.wrist)},
                                          {"rightUpperLeg", "hips", Mirrored(f.hip)},
                                          {"rightLowerLeg", "rightUpperLeg", Mirrored(f.knee)},
                                          {"rightFoot", "rightLowerLeg", Mirrored(f.ankle)},
                                          {"rightToes", "rightFoot", Mirrored(f.ball)}}};
  bones.insert(bones.end(), left.begin(), left.end());
  bones.insert(bones.end(), right.begin(), right.end());
  return bones;
}

// The bone's index, in MakeBones' order.
int BoneOfPart(int part) {
  const int first_arm = static_cast<int>(RigPart::kLeftUpperArm);
  const int right_arm = static_cast<int>(RigPart::kRightUpperArm);
  const int left_leg = static_cast<int>(RigPart::kLeftUpperLeg);
  const int right_leg = static_cast<int>(RigPart::kRightUpperLeg);
  if (part < first_arm) return part;
  if (part < right_arm) return 6 + part - first_arm;
  if (part < left_leg) return 14 + part - right_arm;
  return (part < right_leg ? 9 + part - left_leg : 17 + part - right_leg);
}

struct Look {
  DressedActorOptions options;
  HairStyle hair = HairStyle::kShort;
};

Look DrawLook(const DressedActorOptions& options) {
  Look look{options, options.build > 0.5 ? HairStyle::kBob : HairStyle::kShort};
  if (options.seed == 0) return look;
  std::mt19937_64 random(options.seed);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  DressedActorOptions& o = look.options;
  o.height_m *= uniform(0.95, 1.04);
  o.girth *= uniform(0.90, 1.14);
  o.leg_length *= uniform(0.97, 1.03);
  o.arm_length *= uniform(0.97, 1.03);
  o.shoulder_width *= uniform(0.96, 1.04);
  o.build = uniform(0, 1) < 0.5 ? uniform(0, 0.2) : uniform(0.8, 1);
  const double style = uniform(0, 1);
  if (o.build > 0.5) look.hair = style < 0.6 ? HairStyle::kBob : HairStyle::kBun;
  return look;
}

// The body's loose clothes as particles: one for each vertex with room to move and for those that
// hold it. `particle` is V, lengths are those of `mesh`.
void AddLooseLayers(const ActorShape& shape, Outfit outfit, const TriangleMesh& mesh,
                    ClothModel* model) {
  const Eigen::Index num_vertices = mesh.positions.cols();
  std::vector<Looseness> loose;
  for (Eigen::Index v = 0; v < num_vertices; ++v) {
    loose.push_back(BodyLooseness(shape, outfit, mesh.positions.col(v).cast<double>()));
  }
  const auto particle_of = [&](int v) {
    if (model->particle[v] < 0) {
      model->particle[v] = model->num_particles();
      model->freedom_m.push_back(loose[v].freedom);
      model->collides.push_back(false);
    }
    return model->particle[v];
  };
  const auto link = [&](std::vector<ClothModel::Link>* links, int a, int b) {
    if (loose[a].garment != loose[b].garment) return;
    if (loose[a].freedom == 0 && loose[b].freedom == 0) return;
    const double length = (mesh.positions.col(a) - mesh.positions.col(b)).cast<double>().norm();
    const int first = particle_of(a);
    links->push_back({first, particle_of(b), length});
  };
  for (const MeshEdge& edge : MeshEdges(mesh.triangles)) {
    link(&model->stretch, edge.v0, edge.v1);
    int across[2] = {-1, -1};
    for (int side = 0; side < 2; ++side) {
      if (edge.faces[side] < 0) continue;
      for (const int v : mesh.triangles.col(edge.faces[side])) {
        if (v != edge.v0 && v != edge.v1) across[side] = v;
      }
    }
    if (across[0] >= 0 && across[1] >= 0) link(&model->bend, across[0], across[1]);
  }
}

void AddColliders(const ActorShape& shape, ClothModel* model) {
  // What a sheet around the waist can touch.
  for (const ActorShape::PartCapsule& part : shape.Capsules()) {
    const double top = std::max(part.capsule.a.y(), part.capsule.b.y());
    if (top > shape.waist_y() + 0.06 || top < shape.frame().ankle.y() + 0.05) continue;
    model->colliders.push_back({BoneOfPart(static_cast<int>(part.part)), part.capsule});
  }
}

// From fractions about the hips to metres in the scene.
void ScaleToScene(double height, double hips_height, TriangleMesh* mesh, ClothModel* model) {
  mesh->positions.row(1).array() += static_cast<float>(hips_height);
  mesh->positions *= static_cast<float>(height);
  for (std::vector<ClothModel::Link>* links : {&model->stretch, &model->bend, &model->tethers}) {
    for (ClothModel::Link& link : *links) link.rest_m *= height;
  }
  for (double& freedom : model->freedom_m) freedom *= height;
  for (ClothModel::Collider& collider : model->colliders) {
    Capsule& c = collider.capsule;
    for (Vector3d* end : {&c.a, &c.b}) *end = height * (*end + Vector3d(0, hips_height, 0));
    c.radius_a *= height;
    c.radius_b *= height;
  }
}

// Lets the cloth hang at bind.
void Settle(const ClothModel& model, TriangleMesh* mesh) {
  if (model.num_particles() == 0) return;
  Eigen::Matrix3Xd positions(3, model.num_particles());
  for (Eigen::Index v = 0; v < mesh->positions.cols(); ++v) {
    if (model.particle[v] >= 0) {
      positions.col(model.particle[v]) = mesh->positions.col(v).cast<double>();
    }
  }
  CapsuleSet colliders;
  for (const ClothModel::Collider& collider : model.colliders)
    colliders.push_back(collider.capsule);
  ClothSimulator simulator(model, positions, colliders);
  for (double t = 0; t < kSettleS; t += kSettleStepS) {
    simulator.Step(kSettleStepS, positions, colliders, kSettleDamping);
  }
  for (Eigen::Index v = 0; v < mesh->positions.cols(); ++v) {
    if (model.particle[v] >= 0) {
      mesh->positions.col(v) = simulator.positions().col(model.particle[v]).cast<float>();
    }
  }
}

}  // namespace

std::string_view OutfitName(Outfit outfit) {
  switch (outfit) {
    case Outfit::kTight:
      return "tight";
    case Outfit::kCasual:
      return "casual";
    case Outfit::kSkirt:
      return "skirt";
    case Outfit::kCoat:
      return "coat";
  }
  throw Error(ErrorCode::kInvalidArgument, "not an Outfit");
}

void DressedActorOptions::Validate() const {
  std::string faults;
  const auto check = [&](const char* name, double value, double least, double most) {
    if (value >= least && value <= most) return;
    faults += fmt::format("{}{} is {}, expected {} to {}", faults.empty() ? "" : "; ", name, value,
                          least, most);
  };
  check("outfit", static_cast<double>(outfit), 0, kAllOutfits.size() - 1.0);
  check("height_m", height_m, 0.5, 3);
  check("girth", girth, 0.7, 1.5);
  check("build", build, 0, 1);
  check("leg_length", leg_length, 0.7, 1.3);
  check("arm_length", arm_length, 0.7, 1.3);
  check("shoulder_width", shoulder_width, 0.7, 1.3);
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid actor: " + faults);
}

DressedActor MakeDressedActor(const DressedActorOptions& options) {
  options.Validate();
  const Look look = DrawLook(options);
  const ActorShape shape(look.options, look.hair);
  const BodyFrame& frame = shape.frame();

  // The closed body and the sheet, in fractions of the height, as one mesh without seams.
  TriangleMesh mesh =
      ExtractSurface([&](const Vector3d& x) { return shape.Distance(x); }, GridPlanes(frame));
  const auto num_body = static_cast<int>(mesh.positions.cols());
  const auto num_body_triangles = static_cast<int>(mesh.triangles.cols());
  std::vector<int> parts;
  for (int v = 0; v < num_body; ++v) {
    parts.push_back(static_cast<int>(shape.NearestPart(mesh.positions.col(v).cast<double>())));
  }
  SkinWeights skin = DiffuseWeights(mesh, parts, kNumRigParts);

  std::vector<int> group;
  for (int t = 0; t < num_body_triangles; ++t) {
    const int part = parts[mesh.triangles(0, t)];
    const bool head = part == static_cast<int>(RigPart::kHead);
    const bool arm = part >= static_cast<int>(RigPart::kLeftUpperArm) &&
                     part < static_cast<int>(RigPart::kLeftUpperLeg);
    const bool leg = part >= static_cast<int>(RigPart::kLeftUpperLeg);
    group.push_back(head ? 0 : arm ? 1 : leg ? 2 : 3);
  }
  FlatTriangles flat = ProjectAlongAxes(mesh, group);
  std::vector<float> chart_scale(
      static_cast<size_t>(*std::max_element(flat.chart.begin(), flat.chart.end()) + 1), 1.0F);
  for (int t = 0; t < num_body_triangles; ++t) {
    if (group[t] == 0) chart_scale[flat.chart[t]] = 2;
  }

  DressedActor actor;
  ClothModel& cloth = actor.cloth;
  cloth.particle.assign(static_cast<size_t>(num_body), -1);
  AddLooseLayers(shape, look.options.outfit, mesh, &cloth);
  const Sheet sheet = MakeSheet(shape, look.options.outfit);
  if (sheet.rings > 0) {
    const int first_particle = cloth.num_particles();
    AddSheet(sheet, &cloth);
    for (int p = 0; p < sheet.num_particles(); ++p) cloth.particle.push_back(first_particle + p);
    AddColliders(shape, &cloth);
    mesh.positions.conservativeResize(3, num_body + sheet.num_particles());
    mesh.positions.rightCols(sheet.num_particles()) = sheet.mesh.positions;
    mesh.triangles.conservativeResize(3, num_body_triangles + sheet.mesh.triangles.cols());
    mesh.triangles.rightCols(sheet.mesh.triangles.cols()) = sheet.mesh.triangles.array() + num_body;
    skin.Append(sheet.parts, sheet.weights);
    const auto chart = static_cast<int>(chart_scale.size());
    flat.chart.insert(flat.chart.end(), sheet.flat.chart.size(), chart);
    flat.corners.insert(flat.corners.end(), sheet.flat.corners.begin(), sheet.flat.corners.end());
    chart_scale.push_back(1);
  }

  const auto num_vertices = static_cast<int>(mesh.positions.cols());
  const TextureAtlas atlas =
      PackAtlas(flat, mesh.triangles, num_vertices, chart_scale, kTextureSize);
  const ActorPaint paint(shape, DrawWardrobe(options.seed, look.options.build), options.outfit);
  const cv::Mat picture = PaintAtlas(atlas, [&](int t, const Eigen::Vector3f& barycentric) {
    Eigen::Vector3f x = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) x += barycentric[i] * mesh.positions.col(mesh.triangles(i, t));
    if (t < num_body_triangles) return paint.Body(x.cast<double>());
    const Eigen::Vector2f place = flat.corners[t] * barycentric;
    return paint.Garment(place.x(), place.y(), x.cast<double>());
  });

  ScaleToScene(look.options.height_m, frame.hips_height, &mesh, &cloth);
  Settle(cloth, &mesh);

  RigMesh out;
  out.name = "body";
  out.mesh.positions = mesh.positions(Eigen::all, atlas.source);
  out.mesh.triangles = atlas.triangles;
  out.uv = atlas.uv;
  out.bones = skin.indices(Eigen::all, atlas.source).unaryExpr(&BoneOfPart);
  out.weights = skin.weights(Eigen::all, atlas.source);
  out.bones = (out.weights.array() > 0).select(out.bones, 0);
  if (!cv::imencode(".png", picture, out.texture)) {
    throw Error(ErrorCode::kWriteFailed, "the actor's texture could not be encoded");
  }
  std::vector<int> particle;
  for (const int v : atlas.source) particle.push_back(cloth.particle[v]);
  cloth.particle = std::move(particle);
  if (cloth.num_particles() == 0) cloth = {};

  actor.rig.source = "procedural actor";
  actor.rig.meshes.push_back(std::move(out));
  for (const BonePlan& plan : MakeBones(frame)) {
    RigBone bone;
    bone.name = plan.name;
    bone.parent = actor.rig.FindBone(plan.parent);
    bone.scene_from_bone.translation() =
        look.options.height_m * (plan.origin + Vector3d(0, frame.hips_height, 0));
    actor.rig.bones.push_back(bone);
  }
  return actor;
}

}  // namespace mpc
