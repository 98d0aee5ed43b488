#include "actor_shape.h"

#include <algorithm>
#include <cmath>

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kBlend = 0.022;  // reach of the smooth union
constexpr double kSoleBelowAnkle = 0.039;
constexpr double kThigh = 0.245;
constexpr double kShank = 0.246;
constexpr double kFar = 1;

// Smooth minimum (polynomial): equal to the minimum where the two differ by more than `reach`.
double SmoothUnion(double a, double b, double reach) {
  const double h = std::max(reach - std::abs(a - b), 0.0) / reach;
  return std::min(a, b) - 0.25 * h * h * reach;
}

double BoxDistance(const Solid& solid, const Vector3d& x) {
  return (solid.box_min - x).cwiseMax(x - solid.box_max).cwiseMax(0.0).norm();
}

// Solids too far away to matter are not evaluated.
double Union(const std::vector<Solid>& solids, const Vector3d& x, double start, double reach) {
  for (const Solid& solid : solids) {
    if (BoxDistance(solid, x) < start + reach) start = SmoothUnion(start, solid.Distance(x), reach);
  }
  return start;
}

Solid Ellipsoid(RigPart part, const Vector3d& centre, const Vector3d& radii) {
  Solid s{part, Solid::Kind::kEllipsoid, centre, centre, radii, 1, {}, {}, {}};
  s.box_min = centre - radii;
  s.box_max = centre + radii;
  return s;
}

Solid Cone(RigPart part, const Vector3d& a, double radius_a, const Vector3d& b, double radius_b) {
  Solid s{part, Solid::Kind::kCone, a, b, {radius_a, radius_b, 0}, 1, {}, {}, {}};
  const double radius = std::max(radius_a, radius_b);
  s.box_min = a.cwiseMin(b).array() - radius;
  s.box_max = a.cwiseMax(b).array() + radius;
  return s;
}

Solid Loft(RigPart part, int axis, std::vector<Solid::Station> stations) {
  Solid s{part, Solid::Kind::kLoft, {}, {}, {}, axis, std::move(stations), {}, {}};
  s.box_min.setConstant(kFar);
  s.box_max.setConstant(-kFar);
  for (const Solid::Station& t : s.stations) {
    const Vector3d centre = axis == 0 ? Vector3d(t.at, t.u, t.v) : Vector3d(t.u, t.at, t.v);
    const Vector3d half = axis == 0 ? Vector3d(0, t.ru, t.rv) : Vector3d(t.ru, 0, t.rv);
    s.box_min = s.box_min.cwiseMin(centre - half);
    s.box_max = s.box_max.cwiseMax(centre + half);
  }
  return s;
}

double EllipsoidDistance(const Vector3d& scaled, const Vector3d& radii) {
  const double k0 = scaled.norm();
  const double k1 = scaled.cwiseQuotient(radii).norm();
  return k1 < 1e-9 ? -radii.minCoeff() : k0 * (k0 - 1) / k1;
}

void Widen(std::vector<Solid::Station>* stations, double factor) {
  for (Solid::Station& s : *stations) {
    s.ru *= factor;
    s.rv *= factor;
  }
}

double Mix(double a, double b, double t) { return a + t * (b - a); }

}  // namespace

BodyFrame MakeBodyFrame(const DressedActorOptions& o) {
  BodyFrame f;
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
  f.fingertip = f.wrist + Vector3d(0.104 * o.arm_length, 0, 0);
  f.hip = {0.055, 0, 0};
  f.knee = f.hip - Vector3d(0, kThigh * o.leg_length, 0);
  f.ankle = f.knee - Vector3d(0, kShank * o.leg_length, 0);
  f.ball = f.ankle + Vector3d(0, -0.024, 0.075);
  return f;
}

RigPart OnRightSide(RigPart part) {
  using enum RigPart;
  if (part < kLeftUpperArm) return part;
  const int offset = part >= kLeftUpperLeg
                         ? static_cast<int>(kRightUpperLeg) - static_cast<int>(kLeftUpperLeg)
                         : static_cast<int>(kRightUpperArm) - static_cast<int>(kLeftUpperArm);
  return static_cast<RigPart>(static_cast<int>(part) + offset);
}

// Cubic Hermite between the stations.
Solid::Station Solid::Section(double at) const {
  const int n = static_cast<int>(stations.size());
  if (at <= stations.front().at) return stations.front();
  if (at >= stations.back().at) return stations.back();
  int i = 0;
  while (stations[i + 1].at < at) ++i;
  const Station& p = stations[i];
  const Station& q = stations[i + 1];
  const Station& before = stations[std::max(i - 1, 0)];
  const Station& after = stations[std::min(i + 2, n - 1)];
  const double length = q.at - p.at;
  const double t = (at - p.at) / length;
  const auto cubic = [&](double Station::*value) {
    const double slope_p = length * (q.*value - before.*value) / (q.at - before.at);
    const double slope_q = length * (after.*value - p.*value) / (after.at - p.at);
    const double t2 = t * t;
    const double t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * (p.*value) + (t3 - 2 * t2 + t) * slope_p +
           (3 * t2 - 2 * t3) * (q.*value) + (t3 - t2) * slope_q;
  };
  return {at, cubic(&Station::u), cubic(&Station::v), cubic(&Station::ru), cubic(&Station::rv)};
}

double Solid::Distance(const Vector3d& x) const {
  if (kind == Kind::kEllipsoid) return EllipsoidDistance((x - a).cwiseQuotient(radii), radii);
  if (kind == Kind::kCone) {
    const Vector3d along = b - a;
    const double s = std::clamp(along.dot(x - a) / along.squaredNorm(), 0.0, 1.0);
    return (x - a - s * along).norm() - (radii[0] + s * (radii[1] - radii[0]));
  }
  const Station section = Section(x[axis]);
  const double u = (x[1 - axis] - section.u) / section.ru;
  const double v = (x.z() - section.v) / section.rv;
  const double k0 = std::hypot(u, v);
  const double k1 = std::hypot(u / section.ru, v / section.rv);
  const double across = k1 < 1e-9 ? -std::min(section.ru, section.rv) : k0 * (k0 - 1) / k1;
  const double beyond = std::max(stations.front().at - x[axis], x[axis] - stations.back().at);
  if (across > 0 && beyond > 0) return std::hypot(across, beyond);
  return std::max(across, beyond);
}

ActorShape::ActorShape(const DressedActorOptions& options, HairStyle hair)
    : frame_(MakeBodyFrame(options)) {
  AddHead(hair, options.build);
  AddTrunk(options);
  AddArm(options);
  AddLeg(options);
}

void ActorShape::AddHead(HairStyle style, double build) {
  using enum RigPart;
  const Vector3d& c = frame_.crown;
  const auto at = [&c](double x, double y, double z) { return Vector3d(c + Vector3d(x, y, z)); };
  const double jaw = Mix(1, 0.90, build);
  head_ = {
      Ellipsoid(kHead, at(0, -0.060, -0.005), {0.0425, 0.056, 0.0535}),
      Ellipsoid(kHead, at(0, -0.090, 0.013), {0.036 * jaw, 0.040, 0.040}),
      Ellipsoid(kHead, at(0, -0.118, 0.034), {0.017 * jaw, 0.012, 0.0145}),
      Cone(kHead, at(0, -0.066, 0.050), 0.0045, at(0, -0.084, 0.0585), 0.0075),
      Ellipsoid(kHead, at(0, -0.104, 0.0475), {0.0135, 0.0065, 0.0055}),
      Ellipsoid(kHead, at(0.0435, -0.076, -0.002), {0.0065, 0.0165, 0.0105}),
      Cone(kNeck, frame_.neck + Vector3d(0, -0.030, -0.016), Mix(0.037, 0.031, build),
           frame_.head + Vector3d(0, 0.010, -0.004), Mix(0.034, 0.028, build)),
  };
  hair_ = {Ellipsoid(kHead, at(0, -0.060, -0.008), {0.0500, 0.060, 0.0615})};
  if (style == HairStyle::kBob) {
    hair_.push_back(Ellipsoid(kHead, at(0, -0.092, -0.016), {0.051, 0.044, 0.048}));
  }
  if (style == HairStyle::kBun) {
    hair_.push_back(Ellipsoid(kHead, at(0, -0.040, -0.074), {0.021, 0.021, 0.019}));
  }
}

void ActorShape::AddTrunk(const DressedActorOptions& o) {
  using enum RigPart;
  const double t = frame_.neck.y() / 0.31;
  const double f = o.build;
  const double s = Mix(0.35, 0.65, o.shoulder_width / 2) * 2;  // ribs give way to the shoulders
  std::vector<Solid::Station> stations = {
      {-0.062 * t, 0, -0.006, 0.066, 0.050},
      {-0.020 * t, 0, -0.010, Mix(0.092, 0.099, f), Mix(0.063, 0.066, f)},
      {0.040 * t, 0, -0.004, Mix(0.087, 0.089, f), 0.058},
      {0.100 * t, 0, 0.000, Mix(0.080, 0.070, f), Mix(0.056, 0.050, f)},
      {0.160 * t, 0, 0.002, Mix(0.085, 0.076, f), Mix(0.059, 0.053, f)},
      {0.220 * t, 0, 0.000, Mix(0.094, 0.084, f) * s, Mix(0.064, 0.056, f)},
      {0.262 * t, 0, -0.006, Mix(0.095, 0.085, f) * s, Mix(0.057, 0.051, f)},
      {0.293 * t, 0, -0.012, Mix(0.075, 0.066, f) * s, 0.042},
      {0.316 * t, 0, -0.013, 0.040, 0.034},
  };
  Widen(&stations, o.girth);
  trunk_ = {
      Loft(kChest, 1, stations),
      Ellipsoid(kHips, {0.040, -0.022 * t, -0.034}, {0.050 * o.girth, 0.048, 0.040 * o.girth}),
      Ellipsoid(kHips, {-0.040, -0.022 * t, -0.034}, {0.050 * o.girth, 0.048, 0.040 * o.girth})};
  // From the neck down to the shoulder.
  trunk_.push_back(Cone(kChest, {0.018, 0.300 * t, -0.014}, 0.032 * o.girth,
                        {0.92 * frame_.shoulder.x(), frame_.shoulder.y() - 0.006, -0.008},
                        0.0345 * o.girth * Mix(1, 0.92, f)));
  if (f > 0) {
    const Vector3d radii = o.girth * f * Vector3d(0.037, 0.036, 0.030);
    trunk_.push_back(Ellipsoid(kChest, {0.038, 0.204 * t, 0.040}, radii));
    trunk_.push_back(Ellipsoid(kChest, {-0.038, 0.204 * t, 0.040}, radii));
  }
  trunk_section_ = trunk_.front();
  waist_y_ = 0.045 * t;
  hem_y_ = waist_y_;
  const bool coat = o.outfit == Outfit::kCoat;
  if (o.outfit != Outfit::kCasual && !coat) return;
  // A loose layer hangs from the chest as wide as the wider of chest and hips.
  hem_y_ = coat ? waist_y_ - 0.012 : -0.070 * t;
  std::vector<Solid::Station> shirt;
  double widest_u = 0, widest_v = 0;
  for (auto it = stations.rbegin(); it != stations.rend(); ++it) {
    if (it->at > 0.30 * t) continue;
    widest_u = std::max(widest_u, it->ru);
    widest_v = std::max(widest_v, it->rv);
    const double loose = it->at > 0.25 * t ? 0.006 : 0.010;
    const double ru = it->at > 0.2 * t ? it->ru : Mix(it->ru, widest_u, coat ? 0.4 : 0.75);
    const double rv = it->at > 0.2 * t ? it->rv : Mix(it->rv, widest_v, coat ? 0.4 : 0.75);
    shirt.push_back({std::max(it->at, hem_y_), 0, it->v, ru + loose, rv + loose});
    if (it->at <= hem_y_) break;
  }
  if (shirt.back().at > hem_y_) {
    Solid::Station last = shirt.back();
    last.at = hem_y_;
    shirt.push_back(last);
  }
  std::reverse(shirt.begin(), shirt.end());
  shirt.front().ru += coat ? 0 : 0.006;
  shirt.front().rv += coat ? 0 : 0.010;
  shirt_ = {Loft(kChest, 1, shirt)};
  if (coat) trunk_section_ = shirt_.front();
}

void ActorShape::AddArm(const DressedActorOptions& o) {
  using enum RigPart;
  const double l = o.arm_length;
  const double y = frame_.shoulder.y();
  const double thin = o.girth * Mix(1, 0.88, o.build);
  const auto x = [&](double from_shoulder) { return frame_.shoulder.x() + l * from_shoulder; };
  std::vector<Solid::Station> stations = {
      {x(-0.020), y - 0.008, -0.004, 0.036, 0.038},
      {x(0.012), y - 0.003, -0.003, 0.0365, 0.038},
      {x(0.050), y - 0.001, -0.001, 0.0315, 0.0335},
      {x(0.100), y - 0.001, 0, 0.029, 0.031},
      {x(0.150), y, 0, 0.0245, 0.0255},
      {x(0.186), y, 0, 0.0225, 0.0240},
      {x(0.222), y, 0, 0.0245, 0.0260},
      {x(0.265), y, 0, 0.0212, 0.0222},
      {x(0.312), y, 0, 0.0158, 0.0182},
      {x(0.338), y, 0, 0.0145, 0.0180},
  };
  Widen(&stations, thin);
  const Vector3d& w = frame_.wrist;
  const double h = l * std::sqrt(thin);
  const auto at = [&](double dx, double dy, double dz) {
    return Vector3d(w + Vector3d(l * dx, dy, dz));
  };
  arm_ = {
      Loft(kLeftUpperArm, 0, stations),
      Ellipsoid(kLeftHand, at(0.034, -0.001, 0.002), {0.038 * l, 0.0125 * h, 0.0225 * h}),
      Ellipsoid(kLeftHand, at(0.070, -0.005, 0.000), {0.034 * l, 0.0090 * h, 0.0195 * h}),
      Cone(kLeftHand, at(0.016, -0.004, 0.016), 0.0095 * h, at(0.050, -0.010, 0.037), 0.0075 * h)};
  const bool loose = o.outfit == Outfit::kCasual || o.outfit == Outfit::kCoat;
  cuff_x_ = o.outfit == Outfit::kCoat ? w.x() - 0.004 : x(0.118);
  if (o.outfit == Outfit::kTight) cuff_x_ = x(0.075);
  if (!loose) return;
  std::vector<Solid::Station> sleeve;
  for (const Solid::Station& s : stations) {
    if (s.at > cuff_x_) break;
    const double add = o.outfit == Outfit::kCoat ? 0.0095 : 0.008;
    sleeve.push_back(
        {s.at, s.u - 0.002, s.v, std::max(s.ru, 0.023) + add, std::max(s.rv, 0.023) + add});
  }
  Solid::Station cuff = sleeve.back();
  cuff.at = cuff_x_;
  if (o.outfit == Outfit::kCasual) cuff.ru += 0.004, cuff.rv += 0.002;
  sleeve.push_back(cuff);
  sleeve_ = {Loft(kLeftUpperArm, 0, sleeve)};
}

void ActorShape::AddLeg(const DressedActorOptions& o) {
  using enum RigPart;
  const double l = o.leg_length;
  const double hip_x = frame_.hip.x();
  const bool casual = o.outfit == Outfit::kCasual;
  const double foot = frame_.ankle.y();
  std::vector<Solid::Station> stations = {
      {-0.500 * l, hip_x, -0.004, 0.0205, 0.0255}, {-0.470 * l, hip_x, -0.004, 0.0190, 0.0220},
      {-0.420 * l, hip_x, -0.007, 0.0240, 0.0275}, {-0.350 * l, hip_x, -0.010, 0.0305, 0.0335},
      {-0.290 * l, hip_x, -0.006, 0.0290, 0.0315}, {-0.245 * l, hip_x, 0.002, 0.0285, 0.0315},
      {-0.200 * l, hip_x, 0.002, 0.0325, 0.0355},  {-0.120 * l, hip_x, 0.000, 0.0415, 0.0465},
      {-0.050 * l, hip_x, -0.005, 0.0475, 0.0550}, {-0.005, 0.052, -0.006, 0.0450, 0.0560},
  };
  Widen(&stations, o.girth);
  if (casual || o.outfit == Outfit::kCoat) {
    const double wide = casual ? 1 : 0.5;
    for (Solid::Station& s : stations) {
      const double below_hip = std::clamp(-s.at / 0.2, 0.0, 1.0);
      const double width = Mix(0, 0.008, below_hip);
      s.ru = std::max(s.ru, below_hip * 0.034 * o.girth) + wide * width;
      s.rv = std::max(s.rv, below_hip * 0.036 * o.girth) + wide * width;
    }
  }
  trouser_y_ = foot + (o.outfit == Outfit::kTight ? 0.020 : 0.004);
  if (o.outfit == Outfit::kSkirt) trouser_y_ = frame_.hip.y() - 0.03;
  shoe_y_ = foot + 0.003;
  const Vector3d& a = frame_.ankle;
  const Vector3d& b = frame_.ball;
  leg_ = {Loft(kLeftUpperLeg, 1, stations),
          Ellipsoid(kLeftFoot, a + Vector3d(0, -0.017, -0.014), {0.0235, 0.026, 0.0285}),
          Cone(kLeftFoot, a + Vector3d(0, -0.008, 0.004), 0.0235,
               b + Vector3d(0.001, 0.004, -0.012), 0.0215),
          Ellipsoid(kLeftToes, b + Vector3d(0.003, -0.002, 0.012), {0.0275, 0.0165, 0.037})};
  leg_section_ = leg_.front();
}

double ActorShape::HairDistance(const Vector3d& left) const {
  const double distance = Union(hair_, left, kFar, 0.012);
  // No hair before the hairline: forehead, temples, in front of the ears; nor below the nape.
  const double below = frame_.crown.y() - left.y();
  const double line = below < 0.034   ? 0.070
                      : below < 0.042 ? Mix(0.070, 0.026, (below - 0.034) / 0.008)
                      : below < 0.070 ? Mix(0.026, 0.012, (below - 0.042) / 0.028)
                                      : Mix(0.012, -0.016, std::min((below - 0.070) / 0.040, 1.0));
  const double nape = hair_.size() > 1 && hair_[1].radii.y() > 0.03 ? 0.135 : 0.114;
  return std::max({distance, 0.8 * (left.z() - line), below - nape});
}

double ActorShape::Distance(const Vector3d& x) const {
  // Limbs blend with the trunk but not with the other side's.
  const Vector3d left(std::abs(x.x()), x.y(), x.z());
  double distance = Union(trunk_, left, kFar, kBlend);
  distance = Union(head_, left, distance, 0.010);
  distance = SmoothUnion(distance, HairDistance(left), 0.003);
  distance = Union(arm_, left, distance, 0.012);
  double leg = Union(leg_, left, kFar, 0.012);
  // The legs stay apart.
  if (left.y() < -0.055) leg = std::max(leg, 0.0035 - left.x());
  distance = SmoothUnion(distance, leg, 0.014);
  double shirt = Union(shirt_, left, kFar, kBlend);
  shirt = Union(sleeve_, left, shirt, 0.018);
  distance = SmoothUnion(distance, shirt, 0.004);
  return std::max(distance, -frame_.hips_height - x.y());  // flat soles
}

bool ActorShape::IsHair(const Vector3d& x) const {
  const Vector3d left(std::abs(x.x()), x.y(), x.z());
  return HairDistance(left) < Union(head_, left, kFar, 0.010);
}

RigPart ActorShape::NearestPart(const Vector3d& x) const {
  using enum RigPart;
  const Vector3d left(std::abs(x.x()), x.y(), x.z());
  RigPart part = kHips;
  double nearest = kFar;
  for (const std::vector<Solid>* solids :
       {&trunk_, &shirt_, &head_, &hair_, &arm_, &sleeve_, &leg_}) {
    for (const Solid& solid : *solids) {
      const double distance = solid.Distance(left);
      if (distance >= nearest) continue;
      nearest = distance;
      part = solid.part;
    }
  }
  // Lofts reach over several bones.
  if (part == kChest || part == kHips) {
    if (left.y() < 0.5 * frame_.spine.y()) {
      part = kHips;
      // The layer over the thighs goes with them.
      if (left.y() < -0.035 && left.x() > 0.02) part = kLeftUpperLeg;
    } else {
      part = left.y() < frame_.chest.y() ? kSpine : kChest;
    }
  } else if (part == kLeftUpperArm) {
    if (left.x() > frame_.wrist.x())
      part = kLeftHand;
    else if (left.x() > frame_.elbow.x())
      part = kLeftLowerArm;
  } else if (part == kLeftUpperLeg) {
    if (left.y() < frame_.ankle.y())
      part = kLeftFoot;
    else if (left.y() < frame_.knee.y())
      part = kLeftLowerLeg;
  }
  return x.x() < 0 ? OnRightSide(part) : part;
}

std::vector<ActorShape::PartCapsule> ActorShape::Capsules() const {
  using enum RigPart;
  std::vector<PartCapsule> capsules;
  // The trunk: bars across, as deep as the section and as wide.
  const Solid& trunk = trunk_.front();
  for (double y = trunk.stations.front().at + 0.01; y < 0.9 * frame_.shoulder.y(); y += 0.03) {
    const Solid::Station s = trunk.Section(y);
    const double half = std::max(s.ru - s.rv, 0.0);
    const RigPart part = y < 0.5 * frame_.spine.y() ? kHips
                         : y < frame_.chest.y()     ? kSpine
                                                    : kChest;
    capsules.push_back({part, {{-half, y, s.v}, {half, y, s.v}, s.rv, s.rv}});
  }
  for (const Solid& solid : trunk_) {
    if (solid.kind != Solid::Kind::kEllipsoid || solid.part != kHips) continue;
    const double radius = 1.08 * solid.radii.z();
    const Vector3d across(0.3 * solid.radii.x(), 0, 0);
    capsules.push_back({kHips, {solid.a - across, solid.a + across, radius, radius}});
  }
  const std::vector<Solid::Station>& stations = leg_section_.stations;
  for (size_t i = 0; i + 1 < stations.size(); ++i) {
    const Solid::Station& p = stations[i];
    const Solid::Station& q = stations[i + 1];
    const RigPart part = p.at < frame_.knee.y() - 1e-9 ? kLeftLowerLeg : kLeftUpperLeg;
    const Capsule left{
        {p.u, p.at, p.v}, {q.u, q.at, q.v}, std::max(p.ru, p.rv), std::max(q.ru, q.rv)};
    capsules.push_back({part, left});
    capsules.push_back(
        {OnRightSide(part), {Mirrored(left.a), Mirrored(left.b), left.radius_a, left.radius_b}});
  }
  // A bent knee stands out.
  const Solid::Station knee = leg_section_.Section(frame_.knee.y());
  const double radius = 1.3 * std::max(knee.ru, knee.rv);
  for (const Vector3d& x : {frame_.knee, Mirrored(frame_.knee)}) {
    const RigPart part = x.x() > 0 ? kLeftUpperLeg : OnRightSide(kLeftUpperLeg);
    capsules.push_back({part, {x, x, radius, radius}});
  }
  return capsules;
}

}  // namespace mpc
