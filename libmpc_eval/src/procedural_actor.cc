#include "mpc/eval/procedural_actor.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "iso_surface.h"
#include "mpc/core/error.h"
#include "mpc/skeleton/rig_map.h"

namespace mpc {
namespace {

using Eigen::Vector3d;

// All lengths below are fractions of the height.
constexpr double kCell = 0.0125;
constexpr double kBlend = 0.025;  // reach of the smooth union
constexpr double kSoleBelowAnkle = 0.039;
constexpr double kThigh = 0.245;
constexpr double kShank = 0.246;

// The bones' origins; right ones are mirrored.
struct BonePlan {
  RigPart part;
  const char* name;
  RigPart parent;
  Vector3d origin;
};

// Where the joints are, relative to the middle of the hips.
struct Frame {
  double hips_height;
  Vector3d spine, chest, neck, head, crown;
  Vector3d shoulder, elbow, wrist, fingertip;
  Vector3d hip, knee, ankle, ball;
};

Frame MakeFrame(const ProceduralActorOptions& o) {
  Frame f;
  const double leg = o.leg_length * (kThigh + kShank);
  f.hips_height = leg + kSoleBelowAnkle;
  // What the legs take, the trunk gives.
  const double trunk = (1 - f.hips_height - 0.16) / 0.31;
  f.spine = {0, 0.100 * trunk, 0};
  f.chest = {0, 0.170 * trunk, 0};
  f.neck = {0, 0.310 * trunk, 0};
  f.head = f.neck + Vector3d(0, 0.060, 0);
  f.crown = f.neck + Vector3d(0, 0.160, 0);
  f.shoulder = {0.105 * o.shoulder_width, 0.288 * trunk, 0};
  f.elbow = f.shoulder + Vector3d(0.186 * o.arm_length, 0, 0);
  f.wrist = f.elbow + Vector3d(0.146 * o.arm_length, 0, 0);
  f.fingertip = f.wrist + Vector3d(0.095 * o.arm_length, 0, 0);
  f.hip = {0.055, 0, 0};
  f.knee = f.hip - Vector3d(0, kThigh * o.leg_length, 0);
  f.ankle = f.knee - Vector3d(0, kShank * o.leg_length, 0);
  f.ball = f.ankle + Vector3d(0, -0.027, 0.075);
  return f;
}

Vector3d Mirrored(const Vector3d& x) { return {-x.x(), x.y(), x.z()}; }

std::vector<BonePlan> MakeBones(const Frame& f) {
  using enum RigPart;
  return {{kHips, "hips", kHips, {0, 0, 0}},
          {kSpine, "spine", kHips, f.spine},
          {kChest, "chest", kSpine, f.chest},
          {kNeck, "neck", kChest, f.neck},
          {kHead, "head", kNeck, f.head},
          {kLeftUpperArm, "leftUpperArm", kChest, f.shoulder},
          {kLeftLowerArm, "leftLowerArm", kLeftUpperArm, f.elbow},
          {kLeftHand, "leftHand", kLeftLowerArm, f.wrist},
          {kRightUpperArm, "rightUpperArm", kChest, Mirrored(f.shoulder)},
          {kRightLowerArm, "rightLowerArm", kRightUpperArm, Mirrored(f.elbow)},
          {kRightHand, "rightHand", kRightLowerArm, Mirrored(f.wrist)},
          {kLeftUpperLeg, "leftUpperLeg", kHips, f.hip},
          {kLeftLowerLeg, "leftLowerLeg", kLeftUpperLeg, f.knee},
          {kLeftFoot, "leftFoot", kLeftLowerLeg, f.ankle},
          {kLeftToes, "leftToes", kLeftFoot, f.ball},
          {kRightUpperLeg, "rightUpperLeg", kHips, Mirrored(f.hip)},
          {kRightLowerLeg, "rightLowerLeg", kRightUpperLeg, Mirrored(f.knee)},
          {kRightFoot, "rightFoot", kRightLowerLeg, Mirrored(f.ankle)},
          {kRightToes, "rightToes", kRightFoot, Mirrored(f.ball)}};
}

// A rounded body part: an ellipsoid around a with radii `radii`, or, if `cone`, the hull of a ball
// of radius radii[0] at a and one of radius radii[1] at b.
struct Solid {
  RigPart part;
  bool cone;
  Vector3d a;
  Vector3d b;
  Vector3d radii;
};

// About the distance from x to the solid's surface, negative inside.
double Distance(const Solid& solid, const Vector3d& x) {
  if (solid.cone) {
    const Vector3d axis = solid.b - solid.a;
    const double s = std::clamp(axis.dot(x - solid.a) / axis.squaredNorm(), 0.0, 1.0);
    return (x - solid.a - s * axis).norm() -
           (solid.radii[0] + s * (solid.radii[1] - solid.radii[0]));
  }
  const Vector3d scaled = (x - solid.a).cwiseQuotient(solid.radii);
  const double k0 = scaled.norm();
  const double k1 = scaled.cwiseQuotient(solid.radii).norm();
  return k1 < 1e-9 ? -solid.radii.minCoeff() : k0 * (k0 - 1) / k1;
}

// Trunk, head and the left limbs; the right ones are their mirror.
struct Body {
  std::vector<Solid> trunk;
  std::vector<Solid> arm;
  std::vector<Solid> leg;
};

Body MakeBody(const Frame& f, double girth) {
  using enum RigPart;
  Body body;
  const auto ball = [girth](RigPart part, const Vector3d& centre, const Vector3d& radii) {
    return Solid{part, false, centre, centre, girth * radii};
  };
  const auto fixed = [](RigPart part, const Vector3d& centre, const Vector3d& radii) {
    return Solid{part, false, centre, centre, radii};
  };
  const auto cone = [girth](RigPart part, const Vector3d& a, double radius_a, const Vector3d& b,
                            double radius_b) {
    return Solid{part, true, a, b, girth * Vector3d(radius_a, radius_b, 0)};
  };
  const double chest_y = 0.5 * (f.chest.y() + f.neck.y());
  const double shoulder_x = f.shoulder.x();
  body.trunk = {
      ball(kHips, {0, 0.012, -0.004}, {0.087, 0.070, 0.062}),
      ball(kHips, {0.042, -0.012, -0.030}, {0.050, 0.056, 0.048}),
      ball(kHips, {-0.042, -0.012, -0.030}, {0.050, 0.056, 0.048}),
      ball(kSpine, {0, f.spine.y(), 0}, {0.079, 0.100, 0.056}),
      ball(kChest, {0, chest_y - 0.03, -0.002}, {0.094, 0.105, 0.064}),
      cone(kChest, {-0.75 * shoulder_x, f.shoulder.y() - 0.012, -0.006}, 0.043,
           {0.75 * shoulder_x, f.shoulder.y() - 0.012, -0.006}, 0.043),
      cone(kNeck, f.neck + Vector3d(0, -0.03, -0.012), 0.040, f.head + Vector3d(0, 0, 0.002),
           0.033),
      // The head keeps its size.
      fixed(kHead, f.crown - Vector3d(0, 0.064, -0.008), {0.044, 0.064, 0.055}),
      fixed(kHead, f.crown - Vector3d(0, 0.104, -0.018), {0.031, 0.027, 0.033}),
      fixed(kHead, f.crown - Vector3d(0, 0.078, -0.060), {0.008, 0.013, 0.010}),
  };
  const Vector3d hand = f.fingertip - f.wrist;
  body.arm = {
      ball(kLeftUpperArm, f.shoulder + Vector3d(0.006, -0.004, -0.003), {0.036, 0.034, 0.035}),
      cone(kLeftUpperArm, f.shoulder, 0.033, f.elbow, 0.024),
      cone(kLeftLowerArm, f.elbow, 0.024, f.wrist, 0.0165),
      ball(kLeftLowerArm, f.elbow + 0.3 * (f.wrist - f.elbow), {0.055, 0.025, 0.026}),
      ball(kLeftHand, f.wrist + 0.5 * hand, {0.52 * hand.norm(), 0.012, 0.025}),
      cone(kLeftHand, f.wrist + Vector3d(0.018, -0.003, 0.014), 0.010,
           f.wrist + Vector3d(0.048, -0.006, 0.038), 0.0085),
  };
  const Vector3d outward(0.004, 0, 0);
  body.leg = {
      cone(kLeftUpperLeg, f.hip + outward + Vector3d(0, -0.02, -0.002), 0.048, f.knee, 0.032),
      cone(kLeftLowerLeg, f.knee, 0.031, f.ankle, 0.022),
      ball(kLeftLowerLeg, f.knee + 0.32 * (f.ankle - f.knee) + Vector3d(0, 0, -0.010),
           {0.031, 0.080, 0.031}),
      cone(kLeftFoot, f.ankle + Vector3d(0, -0.012, -0.016), 0.026, f.ball + Vector3d(0, 0.008, 0),
           0.022),
      ball(kLeftToes, f.ball + Vector3d(0.002, -0.002, 0.008), {0.029, 0.013, 0.030}),
  };
  return body;
}

// Smooth minimum (polynomial): equal to the minimum where the two differ by more than `reach`.
double SmoothUnion(double a, double b, double reach) {
  const double h = std::max(reach - std::abs(a - b), 0.0) / reach;
  return std::min(a, b) - 0.25 * h * h * reach;
}

double Union(const std::vector<Solid>& solids, const Vector3d& x, double start, double reach) {
  for (const Solid& solid : solids) start = SmoothUnion(start, Distance(solid, x), reach);
  return start;
}

double BodyDistance(const Body& body, const Vector3d& x, double sole_y) {
  // The body is symmetric. Limbs blend with the trunk but not with the other side's.
  const Vector3d left(std::abs(x.x()), x.y(), x.z());
  double distance = Union(body.trunk, left, 1, kBlend);
  distance = Union(body.arm, left, distance, 0.6 * kBlend);
  const double leg = Union(body.leg, left, 1, 0.6 * kBlend);
  distance = SmoothUnion(distance, leg, kBlend);
  return std::max(distance, sole_y - x.y());  // flat soles
}

// The part whose solid is nearest.
RigPart NearestPart(const Body& body, const Vector3d& x) {
  const Vector3d left(std::abs(x.x()), x.y(), x.z());
  RigPart part = RigPart::kHips;
  double nearest = 1;
  for (const std::vector<Solid>* solids : {&body.trunk, &body.arm, &body.leg}) {
    for (const Solid& solid : *solids) {
      const double distance = Distance(solid, left);
      if (distance >= nearest) continue;
      nearest = distance;
      part = solid.part;
    }
  }
  const bool sided = part >= RigPart::kLeftUpperArm;
  if (!sided || x.x() >= 0) return part;
  const int offset =
      part >= RigPart::kLeftUpperLeg
          ? static_cast<int>(RigPart::kRightUpperLeg) - static_cast<int>(RigPart::kLeftUpperLeg)
          : static_cast<int>(RigPart::kRightUpperArm) - static_cast<int>(RigPart::kLeftUpperArm);
  return static_cast<RigPart>(static_cast<int>(part) + offset);
}

// Each vertex starts on the part it belongs to; then weights diffuse along the surface, so that
// they never leak from one leg or arm to another through the air. K x V, four per vertex.
void DiffuseWeights(const TriangleMesh& mesh, const std::vector<RigPart>& parts,
                    Eigen::MatrixXi* bones, Eigen::MatrixXf* weights) {
  constexpr int kRounds = 10;
  constexpr int kInfluences = 4;
  const Eigen::Index num_vertices = mesh.positions.cols();
  Eigen::MatrixXf dense = Eigen::MatrixXf::Zero(kNumRigParts, num_vertices);
  for (Eigen::Index v = 0; v < num_vertices; ++v) dense(static_cast<int>(parts[v]), v) = 1;
  const std::vector<MeshEdge> edges = MeshEdges(mesh.triangles);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::MatrixXf sum = dense;
    Eigen::RowVectorXf count = Eigen::RowVectorXf::Ones(num_vertices);
    for (const MeshEdge& edge : edges) {
      sum.col(edge.v0) += dense.col(edge.v1);
      sum.col(edge.v1) += dense.col(edge.v0);
      count[edge.v0] += 1;
      count[edge.v1] += 1;
    }
    dense = sum.array().rowwise() / count.array();
  }
  bones->setZero(kInfluences, num_vertices);
  weights->setZero(kInfluences, num_vertices);
  std::array<int, kNumRigParts> order{};
  for (Eigen::Index v = 0; v < num_vertices; ++v) {
    for (int i = 0; i < kNumRigParts; ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return dense(a, v) > dense(b, v); });
    for (int k = 0; k < kInfluences; ++k) {
      const float weight = dense(order[k], v);
      if (weight < 0.01f) break;
      (*bones)(k, v) = order[k];
      (*weights)(k, v) = weight;
    }
    weights->col(v) /= weights->col(v).sum();
  }
}

ProceduralActorOptions Varied(ProceduralActorOptions options) {
  if (options.seed == 0) return options;
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> factor(0.96, 1.04);
  for (double* value : {&options.height_m, &options.girth, &options.leg_length, &options.arm_length,
                        &options.shoulder_width}) {
    *value *= factor(random);
  }
  return options;
}

}  // namespace

void ProceduralActorOptions::Validate() const {
  std::string faults;
  const auto check = [&](const char* name, double value, double least, double most) {
    if (value >= least && value <= most) return;
    faults += fmt::format("{}{} is {}, expected {} to {}", faults.empty() ? "" : "; ", name, value,
                          least, most);
  };
  check("height_m", height_m, 0.5, 3);
  check("girth", girth, 0.7, 1.5);
  check("leg_length", leg_length, 0.7, 1.3);
  check("arm_length", arm_length, 0.7, 1.3);
  check("shoulder_width", shoulder_width, 0.7, 1.3);
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "invalid actor: " + faults);
}

RigAsset ProceduralActor(const ProceduralActorOptions& options) {
  options.Validate();
  const ProceduralActorOptions varied = Varied(options);
  const double height = varied.height_m;
  const Frame frame = MakeFrame(varied);
  const Body body = MakeBody(frame, varied.girth);

  const double reach = frame.fingertip.x() + 0.03;
  const double sole_y = -frame.hips_height;
  // Half a cell off the plane x = 0 on both sides keeps the mesh symmetric.
  const double half_width = (std::ceil(reach / kCell) + 0.5) * kCell;
  TriangleMesh mesh =
      ExtractSurface([&](const Vector3d& x) { return BodyDistance(body, x, sole_y); },
                     {-half_width, sole_y - 1.5 * kCell, -0.15},
                     {half_width, frame.crown.y() + 0.03, 0.18}, kCell);

  RigAsset rig;
  rig.source = "procedural actor";
  std::vector<RigPart> parts;
  for (Eigen::Index v = 0; v < mesh.positions.cols(); ++v) {
    parts.push_back(NearestPart(body, mesh.positions.col(v).cast<double>()));
  }
  RigMesh skin;
  skin.name = "body";
  DiffuseWeights(mesh, parts, &skin.bones, &skin.weights);
  mesh.positions.row(1).array() += static_cast<float>(frame.hips_height);
  skin.uv.resize(2, mesh.positions.cols());
  skin.uv.row(0) = 0.5f + mesh.positions.row(0).array() / static_cast<float>(2 * reach);
  skin.uv.row(1) = 1 - mesh.positions.row(1).array();
  skin.uv = skin.uv.cwiseMax(0.0f).cwiseMin(1.0f);
  mesh.positions *= static_cast<float>(height);
  skin.mesh = std::move(mesh);
  rig.meshes.push_back(std::move(skin));

  for (const BonePlan& plan : MakeBones(frame)) {
    RigBone bone;
    bone.name = plan.name;
    bone.parent = plan.part == RigPart::kHips ? -1 : static_cast<int>(plan.parent);
    bone.scene_from_bone.translation() = height * (plan.origin + Vector3d(0, frame.hips_height, 0));
    rig.bones.push_back(bone);
  }
  return rig;
}

}  // namespace mpc
