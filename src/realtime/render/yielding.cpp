#include "realtime/render/yielding.h"

#include <algorithm>
#include <limits>

namespace hapticd::realtime {
namespace {

using geometry::Mat3;

bool isYielding(const ContactConstraint& constraint, double stiffness_N_per_m, double toolRadius_m) {
  const double limit = constraint.surface.popthrough_N;
  return constraint.source >= 0 && limit > 0 && stiffness_N_per_m * constraint.depth_m > limit &&
         2 * stiffness_N_per_m * toolRadius_m > limit;
}

// A part of the law of one face: from the depth that the others leave it to the length of its spring.
struct Piece {
  double begin_m = 0;
  double end_m = 0;
  double slope = 0;
  double offset_m = 0;

  // By how much a depth is outside.
  double misses(double depth_m) const { return std::max({0.0, begin_m - depth_m, depth_m - end_m}); }
};

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The pieces of one face, or of none.
struct Law {
  std::array<Piece, 5> pieces;
  int count = 0;

  Law() { add({-kInfinity, kInfinity, 0, 0}); }
  // From `limit_m` on the face yields, until there is room behind it at `room_m`. It is no longer than its
  // own depth makes it.
  Law(double depth_m, bool yields, double limit_m, double room_m) {
    add({-kInfinity, 0, 0, 0});
    add({0, yields ? limit_m : depth_m, 1, 0});
    if (yields) add({limit_m, room_m < depth_m ? room_m : kInfinity, 0, limit_m});
    if (yields && room_m < depth_m) add({room_m, depth_m, 1, limit_m - room_m});
    const double longest = yields ? depth_m - (room_m - limit_m) : depth_m;
    if (!yields || room_m < depth_m) add({depth_m, kInfinity, 0, longest});
  }

 private:
  void add(const Piece& piece) { pieces[static_cast<std::size_t>(count++)] = piece; }
};

using Laws = std::array<Law, kMaxActive>;
using Pieces = std::array<int, kMaxActive>;

// The next choice of one piece of each law; false after the last one.
bool advance(const Laws& laws, Pieces& chosen) {
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (++chosen[i] < laws[i].count) return true;
    chosen[i] = 0;
  }
  return false;
}

struct Lengths {
  Vec3 springs_m = Vec3::Zero();
  Vec3 depths_m = Vec3::Zero();  // that the others leave
};

// The lengths of the springs that are on the laws of all faces. They are unique: the dual of a convex
// problem.
Lengths solve(const Laws& laws, const Mat3& products, const Vec3& heights_m) {
  Lengths best;
  double least = kInfinity;
  Pieces chosen{};
  do {
    Mat3 rows = Mat3::Identity();
    Vec3 right;
    for (int i = 0; i < kMaxActive; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Piece& piece = laws[k].pieces[static_cast<std::size_t>(chosen[k])];
      if (piece.slope > 0) rows.row(i) = products.row(i);
      right[i] = piece.slope * heights_m[i] + piece.offset_m;
    }
    const double determinant = rows.determinant();
    if (!(determinant > 0)) continue;
    const Vec3 springs = rows.inverse() * right;
    const Vec3 depths = heights_m - products * springs + springs;
    double missed = 0;
    for (int i = 0; i < kMaxActive; ++i) {
      const auto k = static_cast<std::size_t>(i);
      missed += laws[k].pieces[static_cast<std::size_t>(chosen[k])].misses(depths[i]);
    }
    if (!(missed < least)) continue;
    least = missed;
    best = {springs, depths};
  } while (least > 0 && advance(laws, chosen));
  return best;
}

Lengths lengthsOf(const ContactSet& contactSet, const std::array<bool, kMaxActive>& yields,
                  double toolRadius_m) {
  Laws laws;
  Mat3 products = Mat3::Identity();
  Vec3 heights = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const ContactConstraint& constraint = contactSet.constraints[k];
    const Vec3& normal = constraint.halfSpace.normal;
    laws[k] = Law(constraint.depth_m, yields[k],
                  constraint.surface.popthrough_N / contactSet.spring.stiffness_N_per_m, 2 * toolRadius_m);
    heights[i] = normal.dot(contactSet.normal_m);
    for (int j = 0; j < contactSet.count; ++j) {
      const Vec3& other = contactSet.constraints[static_cast<std::size_t>(j)].halfSpace.normal;
      if (j != i) products(i, j) = normal.dot(other);
    }
  }
  return solve(laws, products, heights);
}

}  // namespace

Springs springsOf(const ContactSet& contactSet, double toolRadius_m) noexcept {
  Springs springs;
  const double stiffness = contactSet.spring.stiffness_N_per_m;
  const auto count = static_cast<std::size_t>(contactSet.count);
  std::array<bool, kMaxActive> yields{};
  for (std::size_t i = 0; i < count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[i];
    springs.forces_N[i] = stiffness * constraint.depth_m;
    yields[i] = isYielding(constraint, stiffness, toolRadius_m);
    springs.yields = springs.yields || yields[i];
  }
  if (!springs.yields) return springs;
  const Lengths lengths = lengthsOf(contactSet, yields, toolRadius_m);
  for (std::size_t i = 0; i < count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[i];
    const double length = lengths.springs_m[static_cast<Eigen::Index>(i)];
    const double depth = std::min(constraint.depth_m, lengths.depths_m[static_cast<Eigen::Index>(i)]);
    springs.forces_N[i] = stiffness * length;
    springs.sum_N += springs.forces_N[i] * constraint.halfSpace.normal;
    if (yields[i]) springs.stored_J += constraint.surface.popthrough_N * std::max(0.0, depth - length);
  }
  const double length = springs.sum_N.norm() / stiffness;
  const double bearing = length / contactSet.normal_m.norm();
  springs.stored_J += 0.5 * contactSet.spring.kappa_N_per_m *
                      (length * length + bearing * contactSet.lateral_m.squaredNorm());
  return springs;
}

}  // namespace hapticd::realtime
