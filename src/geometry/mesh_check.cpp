#include "geometry/mesh_check.h"

#include <algorithm>

#include "geometry/weld.h"

namespace hapticd::geometry {
namespace {

// A triangle whose height is below this share of its longest edge is a line within float rounding.
constexpr double kFlat = 1e-7;

bool areTriples(std::span<const Vec3f> vertices, std::span<const Triangle> triangles) {
  if (vertices.size() / 3 != triangles.size()) return false;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    if (triangles[i] != Triangle{3 * i, 3 * i + 1, 3 * i + 2}) return false;
  }
  return true;
}

// Groups values by a small key and sorts each group: a counting sort by key, then a short sort per group.
class Groups {
 public:
  explicit Groups(std::size_t keys) : begin_(keys + 1, 0) {}

  template <class ForEach, class Visit>
  void run(const ForEach& forEach, const Visit& visit) {
    forEach([this](std::uint32_t key, std::uint64_t) { ++begin_[key + 1]; });
    for (std::size_t key = 1; key < begin_.size(); ++key) begin_[key] += begin_[key - 1];
    std::vector<std::uint64_t> values(begin_.back());
    std::vector<std::uint32_t> fill(begin_.begin(), begin_.end() - 1);
    forEach([&](std::uint32_t key, std::uint64_t value) { values[fill[key]++] = value; });
    for (std::uint32_t key = 0; key + 1 < begin_.size(); ++key) {
      const std::span<std::uint64_t> group(values.data() + begin_[key], begin_[key + 1] - begin_[key]);
      std::sort(group.begin(), group.end());
      visit(key, group);
    }
  }

 private:
  std::vector<std::uint32_t> begin_;
};

// Valid triangles by welded corners, rotated so that the lowest index comes first.
std::vector<Triangle> soundTriangles(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
                                     const std::vector<std::uint32_t>& welded, MeshReport& report) {
  std::vector<Triangle> sound;
  sound.reserve(triangles.size());
  for (const Triangle& t : triangles) {
    const auto corner = [&](int i) { return t[i] < welded.size() ? welded[t[i]] : kNoVertex; };
    Triangle w{corner(0), corner(1), corner(2)};
    if (std::count(w.begin(), w.end(), kNoVertex) != 0) {
      ++report.incomplete;
      continue;
    }
    if (!hasArea(vertices[w[0]], vertices[w[1]], vertices[w[2]])) {
      ++report.degenerate;
      continue;
    }
    std::rotate(w.begin(), std::min_element(w.begin(), w.end()), w.end());
    sound.push_back(w);
  }
  return sound;
}

// Keeps one of all triangles with the same corners. The key is the lowest corner, the value (next, last,
// winding).
std::vector<Triangle> withoutDuplicates(const std::vector<Triangle>& sound, std::size_t vertices,
                                        MeshReport& report) {
  std::vector<Triangle> unique;
  unique.reserve(sound.size());
  Groups(vertices).run(
      [&](const auto& add) {
        for (const Triangle& t : sound) {
          const auto [next, last] = std::minmax(t[1], t[2]);
          add(t[0], std::uint64_t{next} << 32U | last << 1U | (t[1] < t[2] ? 1U : 0U));
        }
      },
      [&](std::uint32_t lowest, std::span<const std::uint64_t> group) {
        for (std::size_t i = 0; i < group.size(); ++i) {
          if (i > 0 && group[i] >> 1U == group[i - 1] >> 1U) {
            ++report.duplicate;
            continue;
          }
          const auto next = static_cast<std::uint32_t>(group[i] >> 32U);
          const auto last = static_cast<std::uint32_t>(group[i]) >> 1U;
          unique.push_back((group[i] & 1U) != 0 ? Triangle{lowest, next, last}
                                                : Triangle{lowest, last, next});
        }
      });
  return unique;
}

// The key of an edge is its lower end, the value (higher end, direction).
void countEdges(const std::vector<Triangle>& sound, std::size_t vertices, MeshReport& report) {
  Groups(vertices).run(
      [&](const auto& add) {
        for (const Triangle& t : sound) {
          for (std::size_t i = 0; i < 3; ++i) {
            const std::uint32_t a = t[i];
            const std::uint32_t b = t[(i + 1) % 3];
            add(std::min(a, b), std::uint64_t{std::max(a, b)} << 1U | (a < b ? 1U : 0U));
          }
        }
      },
      [&](std::uint32_t, std::span<const std::uint64_t> group) {
        for (std::size_t first = 0; first < group.size();) {
          std::size_t last = first + 1;
          while (last < group.size() && group[last] >> 1U == group[first] >> 1U) ++last;
          if (last - first == 1) ++report.openEdges;
          if (last - first > 2) ++report.crowdedEdges;
          if (last - first == 2 && group[first] == group[first + 1]) ++report.flippedEdges;
          first = last;
        }
      });
}

double signedVolume(std::span<const Vec3f> vertices, const std::vector<Triangle>& sound) {
  if (sound.empty()) return 0;
  const Vec3 origin = vertices[sound[0][0]].cast<double>();
  double six = 0;
  for (const Triangle& t : sound) {
    const Vec3 a = vertices[t[0]].cast<double>() - origin;
    const Vec3 b = vertices[t[1]].cast<double>() - origin;
    const Vec3 c = vertices[t[2]].cast<double>() - origin;
    six += a.dot(b.cross(c));
  }
  return six / 6;
}

}  // namespace

bool hasArea(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const Vec3 u = (b - a).cast<double>();
  const Vec3 v = (c - a).cast<double>();
  const double longest = std::max({u.squaredNorm(), v.squaredNorm(), (v - u).squaredNorm()});
  return u.cross(v).norm() > kFlat * longest;
}

bool MeshReport::clean() const {
  return incomplete + degenerate + duplicate + unwelded + openEdges + crowdedEdges + flippedEdges == 0 &&
         !insideOut;
}

MeshReport checkMesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles) {
  MeshReport report;
  report.triangles = triangles.size();
  const std::vector<std::uint32_t> welded = firstAtSamePosition(vertices);
  if (!areTriples(vertices, triangles)) {
    for (std::uint32_t i = 0; i < welded.size(); ++i)
      report.unwelded += welded[i] != kNoVertex && welded[i] != i ? 1 : 0;
  }
  std::vector<Triangle> sound = soundTriangles(vertices, triangles, welded, report);
  sound = withoutDuplicates(sound, vertices.size(), report);
  countEdges(sound, vertices.size(), report);
  report.insideOut = report.closed() && report.flippedEdges == 0 && signedVolume(vertices, sound) < 0;
  return report;
}

std::vector<std::string> describe(const MeshReport& report) {
  std::vector<std::string> sentences;
  const auto say = [&](std::size_t count, const char* one, const char* many, const char* then) {
    if (count == 0) return;
    sentences.push_back((count == 1 ? std::string("1 ") + one : std::to_string(count) + " " + many) + ": " +
                        then);
  };
  say(report.incomplete, "triangle lacks a corner", "triangles lack a corner", "not felt.");
  say(report.degenerate, "triangle has no area", "triangles have no area",
      "felt only through what lies around.");
  say(report.duplicate, "triangle repeats an earlier one", "triangles repeat earlier ones", "felt once.");
  say(report.unwelded, "vertex lies on an earlier one", "vertices lie on earlier ones", "felt as one point.");
  say(report.openEdges, "edge has a triangle on one side only", "edges have a triangle on one side only",
      "the hand can go around or through there.");
  say(report.crowdedEdges, "edge joins more than two triangles", "edges join more than two triangles",
      "all are felt.");
  say(report.flippedEdges, "edge joins triangles with opposite fronts",
      "edges join triangles with opposite fronts",
      "where only fronts or only backs are touchable, one of the two is not felt.");
  if (report.insideOut) {
    sentences.emplace_back("The fronts look inwards: with front faces alone, it is felt from inside.");
  }
  return sentences;
}

}  // namespace hapticd::geometry
