#include "garment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace mpc {
namespace {

using Eigen::Vector3d;

constexpr double kSheetRoom = 0.0065;  // between a sheet and the body's capsules

struct Cut {
  double top_y;        // the waist
  double bottom_y;     // along the cloth, if it hung straight
  double flare;        // widening per length
  double room;         // between body and cloth at the top
  double opening_rad;  // half of the gap in front
  int rings;
  int columns;
};

Cut MakeCut(const ActorShape& shape, Outfit outfit) {
  const double knee = shape.frame().knee.y();
  if (outfit == Outfit::kSkirt) {
    return {shape.waist_y() + 0.012, knee + 0.01, 0.42, 0.004, 0, 24, 72};
  }
  return {shape.waist_y(), knee - 0.05, 0.24, 0.005, 0.16, 26, 64};
}

double Smooth(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Cloth is cut to fit: a place inside or just above the body, moved out of it.
Vector3d OutsideOf(const std::vector<ActorShape::PartCapsule>& body, Vector3d x) {
  for (const ActorShape::PartCapsule& part : body) {
    const Capsule& c = part.capsule;
    const Vector3d along = c.b - c.a;
    const double squared = along.squaredNorm();
    const double s = squared > 0 ? std::clamp(along.dot(x - c.a) / squared, 0.0, 1.0) : 0.0;
    const Vector3d out = x - c.a - s * along;
    const double radius = c.radius_a + s * (c.radius_b - c.radius_a) + kSheetRoom;
    if (out.norm() < radius) x += (radius - out.norm()) * out.normalized();
  }
  return x;
}

double Length(const TriangleMesh& mesh, int a, int b) {
  return (mesh.positions.col(a) - mesh.positions.col(b)).cast<double>().norm();
}

}  // namespace

Sheet MakeSheet(const ActorShape& shape, Outfit outfit) {
  using enum RigPart;
  Sheet sheet;
  if (outfit != Outfit::kSkirt && outfit != Outfit::kCoat) return sheet;
  const Cut cut = MakeCut(shape, outfit);
  sheet.rings = cut.rings;
  sheet.columns = cut.columns;
  sheet.closed = cut.opening_rad == 0;
  const double length = cut.top_y - cut.bottom_y;
  const Solid::Station top = shape.TrunkSection(cut.top_y);
  const std::vector<ActorShape::PartCapsule> body = shape.Capsules();
  const int num_particles = sheet.num_particles();
  sheet.mesh.positions.resize(3, num_particles);
  sheet.parts.setConstant(3, num_particles, static_cast<int>(kHips));
  sheet.weights.setZero(3, num_particles);
  const double slope = 1 / std::hypot(1.0, cut.flare);
  const int steps = sheet.closed ? sheet.columns : sheet.columns - 1;
  const double turn = (2 * std::numbers::pi - 2 * cut.opening_rad) / steps;
  for (int r = 0; r < sheet.rings; ++r) {
    const double t = static_cast<double>(r) / (sheet.rings - 1);
    const double down = t * length * slope;
    for (int c = 0; c < sheet.columns; ++c) {
      const double angle = cut.opening_rad + turn * c + (sheet.closed ? std::numbers::pi : 0);
      // A slight wave decides where the folds will form.
      const double wave = 0.035 * t * std::sin(9 * angle + 0.7) + 0.025 * t * std::sin(5 * angle);
      const double wide = (cut.room + cut.flare * down) * (1 + wave);
      const int p = sheet.At(r, c);
      const Vector3d x((top.ru + wide) * std::sin(angle), cut.top_y - down,
                       top.v + (top.rv + wide) * std::cos(angle));
      sheet.mesh.positions.col(p) = OutsideOf(body, x).cast<float>();
      // The legs carry some of it, each its side.
      const double legs = 0.7 * Smooth(t);
      const double left = Smooth(0.5 + 0.7 * std::sin(angle));
      sheet.parts(1, p) = static_cast<int>(kLeftUpperLeg);
      sheet.parts(2, p) = static_cast<int>(kRightUpperLeg);
      sheet.weights.col(p) << static_cast<float>(1 - legs), static_cast<float>(legs * left),
          static_cast<float>(legs * (1 - left));
    }
  }
  sheet.mesh.triangles.resize(3, 2 * (sheet.rings - 1) * steps);
  const double around = turn * 0.5 * (top.ru + top.rv) + turn * cut.flare * length * 0.6;
  int t = 0;
  for (int r = 0; r + 1 < sheet.rings; ++r) {
    for (int c = 0; c < steps; ++c) {
      const int corner[4] = {sheet.At(r, c), sheet.At(r + 1, c), sheet.At(r + 1, c + 1),
                             sheet.At(r, c + 1)};
      const auto flat = [&](int i) {
        const int ring = r + (i == 1 || i == 2 ? 1 : 0);
        const int column = c + (i >= 2 ? 1 : 0);
        return Eigen::Vector2f(static_cast<float>(column * around),
                               static_cast<float>(ring * length / (sheet.rings - 1)));
      };
      // Diagonals alternate, so that the cloth has no grain.
      const int first = (r + c) % 2;
      for (int half = 0; half < 2; ++half) {
        Eigen::Matrix<float, 2, 3> corners;
        for (int i = 0; i < 3; ++i) {
          const int k = (first + 2 * half + i) % 4;
          sheet.mesh.triangles(i, t) = corner[k];
          corners.col(i) = flat(k);
        }
        sheet.flat.corners.push_back(corners);
        sheet.flat.chart.push_back(0);
        ++t;
      }
    }
  }
  return sheet;
}

void AddSheet(const Sheet& sheet, ClothModel* model) {
  const int begin = model->num_particles();
  const auto link = [&](std::vector<ClothModel::Link>* links, int a, int b) {
    links->push_back({begin + a, begin + b, Length(sheet.mesh, a, b)});
  };
  const int last = sheet.closed ? sheet.columns : sheet.columns - 1;
  for (int r = 0; r < sheet.rings; ++r) {
    for (int c = 0; c < sheet.columns; ++c) {
      const int p = sheet.At(r, c);
      model->freedom_m.push_back(r == 0 ? 0 : std::numeric_limits<double>::infinity());
      model->collides.push_back(r > 0);
      if (r > 0) link(&model->stretch, sheet.At(r - 1, c), p);
      if (r > 1) link(&model->bend, sheet.At(r - 2, c), p);
      if (r > 0 && c < last) {
        link(&model->stretch, p, sheet.At(r, c + 1));
        // The quad's diagonal that the mesh has.
        if ((r - 1 + c) % 2 == 0)
          link(&model->stretch, sheet.At(r - 1, c), sheet.At(r, c + 1));
        else
          link(&model->stretch, p, sheet.At(r - 1, c + 1));
      }
      if (r > 0 && (sheet.closed || c + 2 < sheet.columns)) {
        link(&model->bend, p, sheet.At(r, c + 2));
      }
      if (r > 1) {
        double length = 0;
        for (int k = 1; k <= r; ++k)
          length += Length(sheet.mesh, sheet.At(k - 1, c), sheet.At(k, c));
        model->tethers.push_back({begin + sheet.At(0, c), begin + p, length});
      }
    }
  }
}

Looseness BodyLooseness(const ActorShape& shape, Outfit outfit, const Vector3d& x) {
  const BodyFrame& f = shape.frame();
  const double ax = std::abs(x.x());
  const bool casual = outfit == Outfit::kCasual;
  if (!casual && outfit != Outfit::kCoat) return {};
  const double room = casual ? 0.009 : 0.005;
  if (ax > f.shoulder.x() + 0.02) {  // sleeves
    if (ax > shape.cuff_x() || x.y() < 0.5 * f.shoulder.y()) return {};
    return {room * Smooth((ax - f.shoulder.x() - 0.02) / 0.06), 1};
  }
  if (x.y() > shape.hem_y() + 0.001) {
    if (!casual) return {};
    return {1.4 * room * Smooth((0.8 * f.shoulder.y() - x.y()) / 0.2), 1};
  }
  if (x.y() > shape.trouser_y()) {
    return {room * Smooth((-0.06 - x.y()) / 0.10), 2};
  }
  return {};
}

}  // namespace mpc
