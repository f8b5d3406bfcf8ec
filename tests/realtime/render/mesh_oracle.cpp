#include "mesh_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace hapticd::realtime::fixture {
namespace {

constexpr double kTouch_m = 2e-8;       // nearer than this is on it
constexpr double kClearance_m = 2e-10;  // kept to what stops a descent
constexpr double kShortest_m = 2e-9;    // a way of a descent that is shorter leads nowhere
constexpr double kBallSlack_m = 1e-9;   // that a ball may be in a face

Vec3 nearestOnEdge(const Vec3& a, const Vec3& b, const Vec3& x) {
  const Vec3 e = b - a;
  const double length2 = e.squaredNorm();
  return length2 > 0 ? Vec3(a + std::clamp(e.dot(x - a) / length2, 0.0, 1.0) * e) : a;
}

// Of two segments; exact enough for a choice of edges.
double distanceOf(const Vec3& a, const Vec3& b, const Vec3& p, const Vec3& q) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= 16; ++i) {
    const Vec3 x = p + (q - p) * (i / 16.0);
    nearest = std::min(nearest, (x - nearestOnEdge(a, b, x)).norm());
  }
  return nearest;
}

std::uint64_t keyOf(std::int64_t i, std::int64_t j, std::int64_t k) {
  const auto part = [](std::int64_t n) { return static_cast<std::uint64_t>(n + (1 << 20)) & 0x1fffff; };
  return part(i) << 42 | part(j) << 21 | part(k);
}

}  // namespace

MeshOracle::MeshOracle(const TriangleMesh& mesh, double toolRadius_m) : radius_(toolRadius_m) {
  weld(mesh);
  findEdges();
  fillGrid();
}

void MeshOracle::weld(const TriangleMesh& mesh) {
  std::map<std::array<float, 3>, std::uint32_t> ids;
  std::vector<std::uint32_t> id;
  for (const auto& v : mesh.vertices) {
    const auto [it, fresh] =
        ids.try_emplace({v.x(), v.y(), v.z()}, static_cast<std::uint32_t>(vertices_.size()));
    if (fresh) vertices_.push_back(v.cast<double>());
    id.push_back(it->second);
  }
  for (const auto& t : mesh.triangles) {
    Face f{{id[t[0]], id[t[1]], id[t[2]]}, {}, {}};
    f.normal = (at(f, 1) - at(f, 0)).cross(at(f, 2) - at(f, 0));
    if (!(f.normal.norm() > 0)) continue;
    f.normal.normalize();
    faces_.push_back(f);
  }
}

void MeshOracle::findEdges() {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::pair<std::size_t, std::size_t>>> edges;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      edges[std::minmax(faces_[i].corner[k], faces_[i].corner[(k + 1) % 3])].emplace_back(i, k);
    }
  }
  for (const auto& [ends, sides] : edges) {
    for (const auto& [i, k] : sides) {
      Face& f = faces_[i];
      f.exterior[k] = std::numbers::pi;  // a border, or an edge of more than two
      if (sides.size() != 2) continue;
      const auto& [other, edge] = sides[0].first == i ? sides[1] : sides[0];
      const Face& g = faces_[other];
      const double angle = std::acos(std::clamp(f.normal.dot(g.normal), -1.0, 1.0));
      const Vec3& apex = at(g, static_cast<int>(edge) + 2);
      f.exterior[k] = f.normal.dot(apex - at(f, static_cast<int>(k))) < 0 ? angle : -angle;
    }
  }
}

void MeshOracle::fillGrid() {
  double sum = 0;
  for (const Face& f : faces_) sum += (at(f, 1) - at(f, 0)).norm();
  cell_ = std::max(2 * sum / static_cast<double>(std::max<std::size_t>(faces_.size(), 1)), 1e-5);
  for (std::uint32_t i = 0; i < faces_.size(); ++i) {
    const Face& f = faces_[i];
    const auto lower = cellOf(at(f, 0).cwiseMin(at(f, 1)).cwiseMin(at(f, 2)));
    const auto upper = cellOf(at(f, 0).cwiseMax(at(f, 1)).cwiseMax(at(f, 2)));
    for (auto x = lower[0]; x <= upper[0]; ++x) {
      for (auto y = lower[1]; y <= upper[1]; ++y) {
        for (auto z = lower[2]; z <= upper[2]; ++z) grid_[keyOf(x, y, z)].push_back(i);
      }
    }
  }
}

std::array<std::int64_t, 3> MeshOracle::cellOf(const Vec3& p) const {
  const auto index = [this](double x) { return static_cast<std::int64_t>(std::floor(x / cell_)); };
  return {index(p.x()), index(p.y()), index(p.z())};
}

MeshOracle::Found MeshOracle::near(const Vec3& p, const Vec3& q, double margin) const {
  const auto lower = cellOf(p.cwiseMin(q) - Vec3::Constant(margin));
  const auto upper = cellOf(p.cwiseMax(q) + Vec3::Constant(margin));
  Found found;
  for (auto x = lower[0]; x <= upper[0]; ++x) {
    for (auto y = lower[1]; y <= upper[1]; ++y) {
      for (auto z = lower[2]; z <= upper[2]; ++z) {
        const auto it = grid_.find(keyOf(x, y, z));
        if (it != grid_.end()) found.insert(found.end(), it->second.begin(), it->second.end());
      }
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

// On which side of the line p-q the edge u-v passes. Both faces of an edge
// compute the same number and get opposite answers, so that no line slips
// between them.
bool MeshOracle::sideOf(std::uint32_t u, std::uint32_t v, const Vec3& p, const Vec3& q) const {
  const Vec3& first = vertices_[std::min(u, v)];
  const Vec3& second = vertices_[std::max(u, v)];
  const bool positive = (first - p).cross(second - p).dot(q - p) >= 0;
  return positive == (u < v);
}

// 1: in by the front, -1: out by the back, 0: past.
int MeshOracle::crossing(const Face& f, const Vec3& p, const Vec3& q) const {
  const double start = f.normal.dot(p - at(f, 0));
  const double end = f.normal.dot(q - at(f, 0));
  if ((start > 0) == (end > 0)) return 0;
  const bool side = sideOf(f.corner[0], f.corner[1], p, q);
  if (side != sideOf(f.corner[1], f.corner[2], p, q) || side != sideOf(f.corner[2], f.corner[0], p, q)) {
    return 0;
  }
  return start > 0 ? 1 : -1;
}

int MeshOracle::entered(const Vec3& p, const Vec3& q) const {
  int count = 0;
  for (const std::uint32_t i : near(p, q, 0)) count += crossing(faces_[i], p, q);
  return count;
}

bool MeshOracle::borderNear(const Vec3& p, const Vec3& q) const {
  const double margin = (q - p).norm() + 1e-6;
  for (const std::uint32_t i : near(p, q, margin)) {
    const Face& f = faces_[i];
    for (int k = 0; k < 3; ++k) {
      if (f.exterior[static_cast<std::size_t>(k)] == std::numbers::pi &&
          distanceOf(at(f, k), at(f, k + 1), p, q) < margin) {
        return true;
      }
    }
  }
  return false;
}

double MeshOracle::sharpestEdge(const Vec3& p, const Vec3& q) const {
  const double margin = 0.3 * (q - p).norm() + radius_ + 1e-6;
  double sharpest = 0;
  for (const std::uint32_t i : near(p, q, margin)) {
    const Face& f = faces_[i];
    for (int k = 0; k < 3; ++k) {
      const double angle = f.exterior[static_cast<std::size_t>(k)];
      if (angle > sharpest && distanceOf(at(f, k), at(f, k + 1), p, q) < margin) sharpest = angle;
    }
  }
  return sharpest;
}

// The share, 0 … 1, of `way` that is free, with a clearance to the obstacle.
double MeshOracle::free(const Vec3& p, const Vec3& way) const {
  const Vec3 q = p + way;
  double t = 1;
  for (const std::uint32_t i : near(p, q, 0)) {
    const Face& f = faces_[i];
    if (crossing(f, p, q) != 1) continue;
    const double start = f.normal.dot(p - at(f, 0));
    const double end = f.normal.dot(q - at(f, 0));
    t = std::min(t, std::max(0.0, (start - kClearance_m) / (start - end)));
  }
  return t;
}

Vec3 MeshOracle::foot(const Face& f, const Vec3& x) const {
  const Vec3 over = x - f.normal * f.normal.dot(x - at(f, 0));
  bool inside = true;
  for (int i = 0; i < 3; ++i) {
    inside = inside && f.normal.dot((at(f, i + 1) - at(f, i)).cross(over - at(f, i))) >= 0;
  }
  if (inside) return over;
  Vec3 nearest = at(f, 0);
  for (int i = 0; i < 3; ++i) {
    const Vec3 candidate = nearestOnEdge(at(f, i), at(f, i + 1), x);
    if ((candidate - x).norm() < (nearest - x).norm()) nearest = candidate;
  }
  return nearest;
}

// Descent directions of a point at x: the steepest one among faces is the pull itself,
// its projection onto a face, or an edge. `out` points away from all touched faces.
std::vector<Vec3> MeshOracle::directions(const Vec3& x, const Vec3& pull, Vec3& out) const {
  std::vector<Vec3> found{pull};
  out = Vec3::Zero();
  for (const std::uint32_t i : near(x, x, kTouch_m)) {
    const Face& f = faces_[i];
    if ((foot(f, x) - x).norm() > kTouch_m || f.normal.dot(x - at(f, 0)) < -kTouch_m) continue;
    out += f.normal;
    found.push_back(pull - f.normal * f.normal.dot(pull));
    for (int k = 0; k < 3; ++k) {
      if ((nearestOnEdge(at(f, k), at(f, k + 1), x) - x).norm() > kTouch_m) continue;
      const Vec3 edge = (at(f, k + 1) - at(f, k)).normalized();
      found.push_back(edge * edge.dot(pull));
    }
  }
  std::sort(found.begin(), found.end(), [](const Vec3& a, const Vec3& b) { return a.norm() > b.norm(); });
  if (out.norm() > 0) out.normalize();
  return found;
}

// All directions are projections of the pull, so that their ends are the
// nearest points along them.
bool MeshOracle::stepPoint(Vec3& x, const Vec3& goal, double reach, double hop) const {
  Vec3 out;
  const std::vector<Vec3> ways = directions(x, goal - x, out);
  Vec3 best = x;
  for (const double lift : {0.0, 0.05 * hop, 0.2 * hop, hop}) {
    const Vec3 start = x + lift * out;
    if (lift > 0 && free(x, start - x) < 1) continue;
    for (const Vec3& way : ways) {
      if (way.norm() < kShortest_m) break;
      const Vec3 limited = way * std::min(1.0, reach / way.norm());
      const Vec3 end = start + free(start, limited) * limited;
      if ((goal - end).norm() < (goal - best).norm()) best = end;
    }
  }
  const bool nearer = (goal - best).norm() < (goal - x).norm() - 1e-15;
  x = best;
  return nearer;
}

// Moves the ball's centre off the faces that it overlaps.
bool MeshOracle::pushedOut(Vec3& x) const {
  for (int k = 0; k < 40; ++k) {
    Vec3 away = Vec3::Zero();
    double nearest = radius_ - kBallSlack_m;
    for (const std::uint32_t i : near(x, x, radius_)) {
      const Face& f = faces_[i];
      if (f.normal.dot(x - at(f, 0)) < 0) continue;
      const Vec3 from = x - foot(f, x);
      if (!(from.norm() < nearest)) continue;
      nearest = from.norm();
      away = nearest > 1e-12 ? Vec3(from / nearest) : f.normal;
    }
    if (away.isZero(0)) return true;
    x += (radius_ - nearest) * away;
  }
  return false;
}

std::vector<Vec3> MeshOracle::awayFromTouched(const Vec3& x) const {
  std::vector<Vec3> normals;
  for (const std::uint32_t i : near(x, x, radius_ + 1e-6)) {
    const Face& f = faces_[i];
    if (f.normal.dot(x - at(f, 0)) < 0) continue;
    const Vec3 from = x - foot(f, x);
    if (from.norm() > radius_ + 1e-6) continue;
    const Vec3 n = from.normalized();
    const auto same = [&](const Vec3& other) { return (other - n).norm() < 1e-4; };
    if (std::none_of(normals.begin(), normals.end(), same)) normals.push_back(n);
  }
  return normals;
}

// The free space of a ball has curved faces: steps along them, each followed by a push
// outwards.
bool MeshOracle::stepBall(Vec3& x, const Vec3& goal, double reach) const {
  const Vec3 pull = goal - x;
  const std::vector<Vec3> normals = awayFromTouched(x);
  std::vector<Vec3> ways{pull};
  for (const Vec3& n : normals) {
    ways.push_back(pull - n * n.dot(pull));
    for (const Vec3& m : normals) {
      const Vec3 along = n.cross(m);
      if (along.norm() > 1e-4) ways.push_back(along * along.dot(pull) / along.squaredNorm());
    }
  }
  for (const Vec3& way : ways) {
    for (double step = std::min(1e-4, reach); step > 2e-8 && way.norm() > kShortest_m; step *= 0.4) {
      Vec3 end = x + way * std::min(1.0, step / way.norm());
      if (!pushedOut(end) || free(x, end - x) < 1) continue;
      if ((goal - end).norm() > (goal - x).norm() - 1e-13) continue;
      x = end;
      return true;
    }
  }
  return false;
}

Vec3 MeshOracle::descend(const Vec3& start, const Vec3& goal, double reach_m, double hop_m) const {
  Vec3 x = start;
  for (int i = 0; i < 2000; ++i) {
    const double left = reach_m - (x - start).norm();
    if (left < 1e-7) break;
    const double step = std::min(left, 1e-6 + 0.2 * (x - start).norm());
    if (!(radius_ > 0 ? stepBall(x, goal, step) : stepPoint(x, goal, left, hop_m))) break;
  }
  return x;
}

}  // namespace hapticd::realtime::fixture
