#include "realtime/render/active_set.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {
namespace {

constexpr double kFeasible_m = 1e-12;

// Two normals closer than this (as |n1 x n2|^2), or three with a smaller determinant, are dependent within
// rounding; the solution that would need them differs by less than the tolerance from one with fewer
// half-spaces.
constexpr double kMinCrossSquared = 1e-12;
constexpr double kMinDeterminant = 1e-9;

// Relative to `from`: half-space i demands n_i . y >= c_i for y = x - from. h is the target in the same
// frame.
struct Problem {
  const Vec3* normal[kMaxHalfSpaces];
  double c[kMaxHalfSpaces];
  Vec3 h;
};

struct Candidate {
  Vec3 y;
  int count = 0;
  std::array<int, kMaxActive> active{};
  std::array<double, kMaxActive> multiplier{};
};

bool solveOne(const Problem& p, int i, Candidate& out) {
  const double lambda = p.c[i] - p.normal[i]->dot(p.h);
  if (!(lambda >= 0)) return false;
  out.y = p.h + lambda * *p.normal[i];
  out.count = 1;
  out.active = {i, 0, 0};
  out.multiplier = {lambda, 0, 0};
  return true;
}

// By cross products: the Gram matrix would square the condition number.
bool solveTwo(const Problem& p, int i, int j, Candidate& out) {
  const Vec3& n1 = *p.normal[i];
  const Vec3& n2 = *p.normal[j];
  const Vec3 d = n1.cross(n2);
  const double dd = d.squaredNorm();
  if (!(dd > kMinCrossSquared)) return false;
  const Vec3 u1 = n2.cross(d) / dd;  // u1.n1 = 1, u1.n2 = u1.d = 0
  const Vec3 u2 = d.cross(n1) / dd;
  out.y = p.c[i] * u1 + p.c[j] * u2 + d * (d.dot(p.h) / dd);
  const Vec3 push = out.y - p.h;
  out.multiplier = {u1.dot(push), u2.dot(push), 0};
  out.count = 2;
  out.active = {i, j, 0};
  return out.multiplier[0] >= 0 && out.multiplier[1] >= 0;
}

bool solveThree(const Problem& p, int i, int j, int k, Candidate& out) {
  const Vec3& n1 = *p.normal[i];
  const Vec3& n2 = *p.normal[j];
  const Vec3& n3 = *p.normal[k];
  const Vec3 n23 = n2.cross(n3);
  const double det = n1.dot(n23);
  if (!(std::abs(det) > kMinDeterminant)) return false;
  const Vec3 u1 = n23 / det;
  const Vec3 u2 = n3.cross(n1) / det;
  const Vec3 u3 = n1.cross(n2) / det;
  out.y = p.c[i] * u1 + p.c[j] * u2 + p.c[k] * u3;
  const Vec3 push = out.y - p.h;
  out.multiplier = {u1.dot(push), u2.dot(push), u3.dot(push)};
  out.count = 3;
  out.active = {i, j, k};
  return out.multiplier[0] >= 0 && out.multiplier[1] >= 0 && out.multiplier[2] >= 0;
}

// A candidate that is feasible and optimal is unique, so the first one is the answer.
struct Search {
  const Problem& problem;
  int count;
  double tolerance;
  Candidate found;

  bool feasible(const Candidate& s) const {
    for (int i = 0; i < count; ++i) {
      if (!(problem.normal[i]->dot(s.y) >= problem.c[i] - tolerance)) return false;
    }
    return true;
  }
  bool accept(bool solved, const Candidate& s) {
    if (!solved || !feasible(s)) return false;
    found = s;
    return true;
  }
  bool run() {
    Candidate s;
    s.y = problem.h;
    if (accept(true, s)) return true;
    for (int i = 0; i < count; ++i) {
      if (accept(solveOne(problem, i, s), s)) return true;
    }
    for (int i = 0; i < count; ++i) {
      for (int j = i + 1; j < count; ++j) {
        if (accept(solveTwo(problem, i, j, s), s)) return true;
      }
    }
    for (int i = 0; i < count; ++i) {
      for (int j = i + 1; j < count; ++j) {
        for (int k = j + 1; k < count; ++k) {
          if (accept(solveThree(problem, i, j, k, s), s)) return true;
        }
      }
    }
    return false;
  }
};

}  // namespace

Projection projectOntoActiveSet(const HalfSpace* halfSpaces, int count, const Vec3& target, const Vec3& from,
                                double tolerance) noexcept {
  Problem problem;
  problem.h = target - from;
  for (int i = 0; i < count; ++i) {
    problem.normal[i] = &halfSpaces[i].normal;
    problem.c[i] = -halfSpaces[i].height(from);
  }
  Search search{problem, count, tolerance, {}};
  Projection result;
  if (!search.run()) {
    result.point = from;
    return result;
  }
  result.found = true;
  result.point = from + search.found.y;
  result.count = search.found.count;
  result.active = search.found.active;
  result.multiplier = search.found.multiplier;
  return result;
}

bool depthsBelow(const HalfSpace* halfSpaces, int count, const Vec3& target, double* depths) noexcept {
  std::fill(depths, depths + count, 0.0);
  if (count == 0) return true;
  const Projection nearest = projectOntoActiveSet(halfSpaces, count, target, target, kFeasible_m);
  for (int i = 0; i < nearest.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    depths[nearest.active[k]] = std::max(0.0, nearest.multiplier[k]);
  }
  if (nearest.found) return true;
  const auto height = [&](const HalfSpace& h) { return h.height(target); };
  const HalfSpace* const deepest =
      std::min_element(halfSpaces, halfSpaces + count,
                       [&](const HalfSpace& a, const HalfSpace& b) { return height(a) < height(b); });
  depths[deepest - halfSpaces] = std::max(0.0, -height(*deepest));
  return false;
}

}  // namespace hapticd::realtime
