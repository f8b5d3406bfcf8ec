#include "mesh_io/triangulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using Vec2 = Eigen::Vector2d;

double cross(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

// Without the coordinate in which the normal is longest, and so that the polygon turns left.
std::vector<Vec2> flattened(std::span<const std::uint32_t> corners, const PolygonMesh& polygons) {
  const auto at = [&](std::size_t i) {
    return polygons.vertices[corners[i % corners.size()]].cast<double>().eval();
  };
  Vec3 normal = Vec3::Zero();
  const Vec3 origin = at(0);
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) normal += (at(i) - origin).cross(at(i + 1) - origin);
  Eigen::Index longest = 0;
  normal.cwiseAbs().maxCoeff(&longest);
  const Eigen::Index u = (longest + 1) % 3;
  const Eigen::Index v = (longest + 2) % 3;
  const double turn = normal[longest] < 0 ? -1 : 1;
  std::vector<Vec2> flat;
  for (std::size_t i = 0; i < corners.size(); ++i) flat.emplace_back(at(i)[u], turn * at(i)[v]);
  return flat;
}

// Cuts off one corner after the other. What remains keeps the signed area: where no ear has a negative one,
// the ears do not overlap.
class EarCutter {
 public:
  explicit EarCutter(std::vector<Vec2> flat) : flat_(std::move(flat)), left_(flat_.size()) {
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = i;
  }

  /// The corners of the next ear; call it n - 2 times.
  std::array<std::size_t, 3> next() {
    const std::size_t i = find();
    const std::array<std::size_t, 3> ear = {before(i), left_[i], after(i)};
    left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(i));
    begin_ = i < left_.size() ? i + 1 : 1;  // not a fan around one corner
    return ear;
  }

 private:
  std::size_t before(std::size_t i) const { return left_[(i + left_.size() - 1) % left_.size()]; }
  std::size_t after(std::size_t i) const { return left_[(i + 1) % left_.size()]; }
  double areaAt(std::size_t i) const { return cross(flat_[before(i)], flat_[left_[i]], flat_[after(i)]); }

  // Where there is none, as in a face that crosses itself, the corner that overlaps the least.
  std::size_t find() const {
    std::size_t flattest = 0;
    for (std::size_t k = 0; k < left_.size(); ++k) {
      const std::size_t i = (begin_ + k) % left_.size();
      if (areaAt(i) > 0 && isEmpty(i)) return i;
      if (std::abs(areaAt(i)) < std::abs(areaAt(flattest))) flattest = i;
    }
    return flattest;
  }

  // No other corner is inside or on the edge that the ear leaves.
  bool isEmpty(std::size_t i) const {
    const Vec2& a = flat_[before(i)];
    const Vec2& b = flat_[left_[i]];
    const Vec2& c = flat_[after(i)];
    return std::none_of(left_.begin(), left_.end(), [&](std::size_t k) {
      const Vec2& p = flat_[k];
      if (p == a || p == b || p == c) return false;
      return cross(a, b, p) > 0 && cross(b, c, p) > 0 && cross(c, a, p) >= 0;
    });
  }

  const std::vector<Vec2> flat_;
  std::vector<std::size_t> left_;
  std::size_t begin_ = 1;
};

}  // namespace

geometry::TriangleMesh triangulated(PolygonMesh polygons) {
  geometry::TriangleMesh mesh;
  const std::uint32_t* face = polygons.corners.data();
  for (const std::uint32_t size : polygons.sizes) {
    const std::span corners(face, size);
    face += size;
    requireRoom(mesh.triangles.size() + size);
    if (size == 3) {
      mesh.triangles.push_back({corners[0], corners[1], corners[2]});
      continue;
    }
    EarCutter cutter(flattened(corners, polygons));
    for (std::uint32_t i = 2; i < size; ++i) {
      const auto [a, b, c] = cutter.next();
      mesh.triangles.push_back({corners[a], corners[b], corners[c]});
    }
  }
  mesh.vertices = std::move(polygons.vertices);
  return mesh;
}

}  // namespace hapticd::mesh_io
