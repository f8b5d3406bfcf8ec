#include "geometry/fans.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>

namespace hapticd::geometry {
namespace {

using Place = std::array<std::uint32_t, 3>;

// A triangle of a fan: the vertices of its rim, in winding order.
struct Spoke {
  std::uint32_t triangle = 0;
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
};

constexpr double kWidest_rad = 0.5;  // of a coarse triangle
constexpr double kDetour = 1e-2;     // the rim may be longer than the edge that stands for it by this share

// The bits of a position, with one zero.
Place placeOf(const Vec3f& v) {
  return {std::bit_cast<std::uint32_t>(v.x() + 0.0F), std::bit_cast<std::uint32_t>(v.y() + 0.0F),
          std::bit_cast<std::uint32_t>(v.z() + 0.0F)};
}

std::uint32_t hashOf(const Place& place) {
  std::uint64_t hash = 0;
  for (const std::uint32_t bits : place) hash = (std::rotl(hash, 23) ^ bits) * 0x9E3779B97F4A7C15U;
  return static_cast<std::uint32_t>(hash >> 32U);
}

// The triangles around each vertex that has at least Fans::kFewest, by its place.
std::map<Place, std::vector<Spoke>> spokesOf(std::span<const Vec3f> vertices,
                                             std::span<const Triangle> triangles,
                                             const std::vector<bool>& leftOut) {
  const auto forEachCorner = [&](auto&& visit) {
    for (std::uint32_t i = 0; i < triangles.size(); ++i) {
      const Triangle& t = triangles[i];
      if ((!leftOut.empty() && leftOut[i]) || std::max({t[0], t[1], t[2]}) >= vertices.size()) continue;
      for (std::size_t k = 0; k < 3; ++k) visit(i, t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
    }
  };
  // Places share a counter here and there; that costs time only.
  std::vector<std::uint32_t> counts(std::bit_ceil(vertices.size() / 2 + 1));
  const auto slotOf = [&](std::uint32_t v) { return hashOf(placeOf(vertices[v])) & (counts.size() - 1); };
  forEachCorner([&](auto, std::uint32_t v, auto, auto) { ++counts[slotOf(v)]; });
  std::map<Place, std::vector<Spoke>> found;
  if (*std::max_element(counts.begin(), counts.end()) < Fans::kFewest) return found;
  forEachCorner([&](std::uint32_t i, std::uint32_t v, std::uint32_t begin, std::uint32_t end) {
    if (counts[slotOf(v)] >= Fans::kFewest) found[placeOf(vertices[v])].push_back({i, begin, end});
  });
  std::erase_if(found, [](const auto& entry) { return entry.second.size() < Fans::kFewest; });
  return found;
}

// Cuts the triangles around a vertex into runs in which each one begins where the one before it ends.
std::vector<std::vector<Spoke>> runsOf(std::span<const Vec3f> vertices, const std::vector<Spoke>& spokes) {
  std::map<Place, std::size_t> beginningAt;
  std::map<Place, int> ends;
  for (std::size_t i = 0; i < spokes.size(); ++i) {
    // Where two triangles begin at one place, there is no order.
    if (!beginningAt.emplace(placeOf(vertices[spokes[i].begin]), i).second) return {};
    ++ends[placeOf(vertices[spokes[i].end])];
  }
  std::vector<bool> used(spokes.size());
  std::vector<std::vector<Spoke>> runs;
  const auto follow = [&](std::size_t i) {
    std::vector<Spoke> run;
    while (!used[i]) {
      used[i] = true;
      run.push_back(spokes[i]);
      const auto next = beginningAt.find(placeOf(vertices[spokes[i].end]));
      if (next == beginningAt.end()) break;
      i = next->second;
    }
    if (run.size() >= Fans::kFewest) runs.push_back(std::move(run));
  };
  for (std::size_t i = 0; i < spokes.size(); ++i) {
    if (!ends.contains(placeOf(vertices[spokes[i].begin]))) follow(i);
  }
  for (std::size_t i = 0; i < spokes.size(); ++i) follow(i);  // those that close
  return runs;
}

double distanceToSegment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const double t = std::clamp((p - a).dot(ab) / std::max(ab.squaredNorm(), 1e-300), 0.0, 1.0);
  return (a + t * ab - p).norm();
}

double angleBetween(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

Fans::Fans(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
           const std::vector<bool>& leftOut) {
  for (const auto& [place, spokes] : spokesOf(vertices, triangles, leftOut)) {
    for (const std::vector<Spoke>& run : runsOf(vertices, spokes)) {
      Fan fan;
      for (const Spoke& spoke : run) {
        fan.rim.push_back(spoke.begin);
        fan.triangles.push_back(spoke.triangle);
      }
      fan.rim.push_back(run.back().end);
      const Triangle& t = triangles[fan.triangles.front()];
      fan.apex =
          *std::find_if(t.begin(), t.end(), [&](std::uint32_t v) { return placeOf(vertices[v]) == place; });
      if (members_.empty()) members_.resize(triangles.size());
      add(vertices, std::move(fan));
    }
  }
}

void Fans::add(std::span<const Vec3f> vertices, Fan fan) {
  // A triangle of two fans would be joined twice.
  if (std::any_of(fan.triangles.begin(), fan.triangles.end(), [&](std::uint32_t t) { return fanOf(t) >= 0; }))
    return;
  const Vec3 apex = vertices[fan.apex].cast<double>();
  const std::size_t count = fan.triangles.size();
  std::vector<Vec3> spokes;
  for (const std::uint32_t v : fan.rim) spokes.push_back(vertices[v].cast<double>() - apex);
  double radius = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i)
    radius = std::min(radius, distanceToSegment(Vec3::Zero(), spokes[i], spokes[i + 1]));
  for (std::size_t step = 2; step <= count / 4; step *= 2) {
    Level level{0, radius};
    for (std::size_t begin = 0; begin < count; begin += step) {
      const std::size_t end = std::min(begin + step, count);
      const Vec3 normal = spokes[begin].cross(spokes[end]).normalized();
      const double width = angleBetween(spokes[begin], spokes[end]);
      double sum = 0;
      for (std::size_t i = begin; i < end; ++i) {
        sum += angleBetween(spokes[i], spokes[i + 1]);
        level.error = std::max(level.error, std::abs(normal.dot(spokes[i].normalized())));
      }
      const bool joins = width < kWidest_rad && sum <= (1 + kDetour) * width;
      if (!joins) level.error = std::numeric_limits<double>::infinity();
      level.radius = std::min(level.radius, distanceToSegment(Vec3::Zero(), spokes[begin], spokes[end]));
    }
    if (!(level.error < 1)) break;
    fan.levels.push_back(level);
  }
  if (fan.levels.empty()) return;
  for (std::size_t i = 0; i < count; ++i)
    members_[fan.triangles[i]] = {static_cast<std::int32_t>(fans_.size()), static_cast<std::uint32_t>(i)};
  fans_.push_back(std::move(fan));
}

int Fans::levelFor(int fan, double radius, double error) const noexcept {
  const std::vector<Level>& levels = fans_[static_cast<std::size_t>(fan)].levels;
  int level = 0;
  for (const Level& coarser : levels) {
    if (!(coarser.error * radius <= error && radius <= coarser.radius)) break;
    ++level;
  }
  return level;
}

Fans::First Fans::firstOf(int level, std::uint32_t triangle) const noexcept {
  const Member& member = members_[triangle];
  const std::uint32_t place = member.rank >> static_cast<unsigned>(level);
  return {fans_[static_cast<std::size_t>(member.fan)].triangles[place << static_cast<unsigned>(level)],
          place};
}

Triangle Fans::joined(int level, std::uint32_t first) const noexcept {
  const Member& member = members_[first];
  const Fan& fan = fans_[static_cast<std::size_t>(member.fan)];
  const std::size_t end =
      std::min(member.rank + (std::size_t{1} << static_cast<unsigned>(level)), fan.triangles.size());
  return {fan.apex, fan.rim[member.rank], fan.rim[end]};
}

}  // namespace hapticd::geometry
