#include "scene/mesh_draft.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "geometry/repeated_triangles.h"

namespace hapticd::scene {
namespace {

constexpr float kNotYet = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint32_t kNoVertex = 0xFFFFFFFF;
constexpr Triangle kNoTriangle{kNoVertex, kNoVertex, kNoVertex};

// Not for NaN.
bool isVertex(const Vec3f& v) {
  constexpr auto kMost = static_cast<float>(MeshDraft::kLargestCoordinate);
  return std::abs(v.x()) <= kMost && std::abs(v.y()) <= kMost && std::abs(v.z()) <= kMost;
}

bool allUsable(const std::vector<Vec3f>& run) {
  bool usable = true;
  for (const Vec3f& v : run) usable &= isVertex(v);
  return usable;
}

RefusedVertices unusableOf(const std::vector<Vec3f>& run) {
  RefusedVertices refused;
  if (allUsable(run)) return refused;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if (isVertex(run[i])) continue;
    if (refused.count == 0) refused = {0, i, run[i]};
    ++refused.count;
  }
  return refused;
}

bool sameBytes(const Vec3f* a, const std::vector<Vec3f>& b) {
  return std::memcmp(a, b.data(), b.size() * sizeof(Vec3f)) == 0;
}

// Empty for a triangle with a corner that is not a number. Uses floats as far as they are exact because it is
// called for each triangle of a mesh at every build.
Box boxOfTriangle(const Triangle& t, const std::vector<Vec3f>& vertices) {
  if (t[0] >= vertices.size() || t[1] >= vertices.size() || t[2] >= vertices.size()) return {};
  const Vec3f& a = vertices[t[0]];
  const Vec3f& b = vertices[t[1]];
  const Vec3f& c = vertices[t[2]];
  // NaN and infinity times 0 are NaN.
  if ((a * 0 + b * 0 + c * 0).sum() != 0) return {};
  return {a.cwiseMin(b).cwiseMin(c).cast<double>(), a.cwiseMax(b).cwiseMax(c).cast<double>()};
}

}  // namespace

void MeshDraft::edited(Nanos now) {
  if (!dirty_) firstEdit_ = now;
  dirty_ = true;
  finished_ = false;
  lastEdit_ = now;
}

void MeshDraft::shapeEdited(Nanos now) {
  shapeChanged_ = true;
  hasDeformed_ = false;
  edited(now);
}

std::optional<Nanos> MeshDraft::due() const {
  if (!dirty_) return std::nullopt;
  if (finished_) return lastEdit_;
  // New positions alone are a moving surface: only the rest of the frame may be missing.
  if (!shapeChanged_) return std::min(lastEdit_ + kPause, firstEdit_ + kQuiet);
  return std::min(lastEdit_ + kQuiet, firstEdit_ + kLongest);
}

void MeshDraft::grow(std::vector<Vec3f>& vertices, std::size_t size) {
  missing_ += size - vertices.size();
  vertices.resize(size, Vec3f::Constant(kNotYet));
}

RefusedVertices MeshDraft::setVertices(std::uint32_t first, std::vector<Vec3f>&& run, Nanos now) {
  const std::size_t before = vertexCount();
  const auto isInPlace = [&] { return first + run.size() <= before; };
  if (isInPlace() && sameBytes(vertices_.read().data() + first, run)) return {};
  const RefusedVertices refused = unusableOf(run);
  // A refused vertex at the end is none that has not come yet.
  const std::size_t sent = run.size();
  while (!run.empty() && !isVertex(run.back())) run.pop_back();
  if (run.empty()) return refused;
  const bool usable = refused.count == sent - run.size();
  // What fills a gap is a part of the shape.
  const bool moves = isInPlace() && missing_ == 0;
  const std::size_t end = first + run.size();
  const auto come = [this](const Vec3f& there) { missing_ -= missing_ > 0 && !isVertex(there) ? 1 : 0; };
  if (usable && first == 0 && end >= before) {
    vertices_.replace(std::move(run));
    missing_ = 0;
  } else if (usable) {
    std::vector<Vec3f>& vertices = vertices_.write(end);
    if (first > before) grow(vertices, first);
    const std::size_t overlap = std::min<std::size_t>(run.size(), vertices.size() - first);
    for (std::size_t i = 0; missing_ > 0 && i < overlap; ++i) come(vertices[first + i]);
    std::copy_n(run.begin(), overlap, vertices.begin() + first);
    vertices.insert(vertices.end(), run.begin() + static_cast<std::ptrdiff_t>(overlap), run.end());
  } else {
    std::vector<Vec3f>& vertices = vertices_.write(end);
    if (end > before) grow(vertices, end);
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (isVertex(run[i])) {
        come(vertices[first + i]);
        vertices[first + i] = run[i];
      }
    }
  }
  if (moves) {
    edited(now);
  } else {
    shapeEdited(now);
  }
  return refused;
}

void MeshDraft::setTriangles(std::uint32_t first, const std::vector<Triangle>& run, Nanos now) {
  const std::size_t end = first + run.size();
  const bool inPlace = indexed_ && end <= triangles_.read().size();
  if (inPlace && std::equal(run.begin(), run.end(), triangles_.read().begin() + first)) return;
  std::vector<Triangle>& triangles = triangles_.write(end);
  if (triangles.size() < end) triangles.resize(end, kNoTriangle);
  std::copy(run.begin(), run.end(), triangles.begin() + first);
  indexed_ = true;
  shapeEdited(now);
}

bool MeshDraft::removeTriangle(std::uint32_t triangle, Nanos now) {
  if (!indexed_ || triangle >= triangles_.read().size() || triangles_.read()[triangle] == kNoTriangle)
    return false;
  triangles_.write(0)[triangle] = kNoTriangle;
  shapeEdited(now);
  return true;
}

void MeshDraft::clear(Nanos now) {
  vertices_ = {};
  triangles_ = {};
  indexed_ = false;
  missing_ = 0;
  shapeEdited(now);
  finished_ = true;
}

namespace {

// In runs, so that a command is no larger than a megabyte or so of memory.
template <class Item, class Add>
void inRuns(const std::vector<Item>& items, const Add& add) {
  constexpr std::size_t kRun = 1U << 20U;
  for (std::size_t first = 0; first < items.size(); first += kRun) {
    const auto begin = items.begin() + static_cast<std::ptrdiff_t>(first);
    add(static_cast<std::int32_t>(first),
        std::vector(begin, begin + static_cast<std::ptrdiff_t>(std::min(kRun, items.size() - first))));
  }
}

}  // namespace

// Triangles first: without them, vertices would count among the triangles, for which there may be no room.
// Vertices that have not come are not numbers and stay so; triangles that were removed come with three equal
// corners and are removed again.
void MeshDraft::appendCommands(std::int32_t object, ClientId client, bool inMetres,
                               std::vector<ClientCommand>& out) const {
  const bool edited = dirty_ && shapeChanged_ && !finished_;
  const Nanos at = edited ? lastEdit_ : 0;
  const auto add = [&](SceneCommand command) { out.push_back({client, std::move(command), at}); };
  const std::vector<Vec3f>& vertices = positionsAreUnderWay() ? current_->shapeVertices() : vertices_.read();
  if (indexed_) {
    std::vector<std::int32_t> removed;
    inRuns(triangles_.read(), [&](std::int32_t first, std::vector<Triangle>&& run) {
      for (std::size_t i = 0; i < run.size(); ++i) {
        if (run[i] != kNoTriangle) continue;
        run[i] = Triangle{};
        removed.push_back(first + static_cast<std::int32_t>(i));
      }
      add(SetTriangles{object, first, std::move(run), inMetres});
    });
    for (const std::int32_t triangle : removed) add(RemoveTriangle{object, triangle});
  }
  inRuns(vertices, [&](std::int32_t first, std::vector<Vec3f>&& run) {
    add(SetVertices{object, first, std::move(run)});
  });
  const std::int32_t past = hasDeformed_ ? 1 : edited && hasBeenPublished() ? 2 : 0;
  if (edited || hasDeformed_) add(ContinueMesh{object, past, edited ? lastEdit_ - firstEdit_ : -1});
}

void MeshDraft::appendEditsUnderWay(std::int32_t object, ClientId client,
                                    std::vector<ClientCommand>& out) const {
  if (!positionsAreUnderWay()) return;
  inRuns(vertices_.read(), [&](std::int32_t first, std::vector<Vec3f>&& run) {
    out.push_back({client, SetVertices{object, first, std::move(run)}, lastEdit_});
  });
  out.push_back({client, ContinueMesh{object, hasDeformed_, lastEdit_ - firstEdit_}, lastEdit_});
}

void MeshDraft::continueFrom(bool hasDeformed, bool wasPublished, std::optional<Nanos> firstEdit, Nanos now) {
  hasDeformed_ = hasDeformed;
  wasPublished_ = wasPublished;
  if (!firstEdit) return;
  edited(now);
  firstEdit_ = *firstEdit;
}

// Triples keep one list as long as their number stays; numbered triangles get a copy only when some lack a
// corner, so that every published number is a vertex.
std::shared_ptr<const std::vector<Triangle>> MeshDraft::shareTriangles() {
  const std::size_t vertexEnd = vertexCount();
  const auto complete = [vertexEnd](const Triangle& t) {
    return t[0] < vertexEnd && t[1] < vertexEnd && t[2] < vertexEnd;
  };
  if (indexed_) {
    std::shared_ptr<const std::vector<Triangle>> shared = triangles_.share();
    if (std::all_of(shared->begin(), shared->end(), complete)) return shared;
    auto copy = std::make_shared<std::vector<Triangle>>(*shared);
    std::replace_if(
        copy->begin(), copy->end(), [&](const Triangle& t) { return !complete(t); }, Triangle{});
    return copy;
  }
  auto triples = std::make_shared<std::vector<Triangle>>(vertexEnd / 3);
  std::uint32_t next = 0;
  for (Triangle& t : *triples) {
    t = {next, next + 1, next + 2};
    next += 3;
  }
  return triples;
}

std::shared_ptr<MeshGeometry> MeshDraft::build(std::uint64_t topology, bool ballTool) {
  auto mesh = std::make_shared<MeshGeometry>();
  mesh->topology = topology;
  mesh->vertices = vertices_.share();
  mesh->triangles = shareTriangles();
  const std::vector<Vec3f>& vertices = *mesh->vertices;
  // Only the list as sent shows which triangles lack a corner; the published one has others in their place.
  const std::vector<Triangle>& triangles = indexed_ ? triangles_.read() : *mesh->triangles;
  // What repeats a triangle cannot be felt apart from it, and would only cost time.
  const std::vector<bool> repeated = geometry::repeatedTriangles(vertices, triangles);
  mesh->index = SpatialIndex::build(static_cast<std::uint32_t>(triangles.size()), [&](std::uint32_t id) {
    return !repeated.empty() && repeated[id] ? Box{} : boxOfTriangle(triangles[id], vertices);
  });
  mesh->bounds = mesh->boundsOnTheWay = mesh->index.bounds();
  if (hasDeformed_) return mesh;
  auto fans = std::make_shared<const geometry::Fans>(vertices, triangles, repeated);
  if (!fans->empty()) mesh->fans = std::move(fans);
  if (ballTool) mesh->discs = std::make_shared<const geometry::DiscTree>(vertices, triangles, repeated);
  return mesh;
}

std::shared_ptr<const MeshGeometry> MeshDraft::commit(Nanos now, std::uint64_t topology, bool ballTool) {
  if (triangleCount() == 0 || !current_ || shapeChanged_) {
    deformation_.restart();
    current_ = triangleCount() > 0 ? build(topology, ballTool) : nullptr;
  } else {
    auto asSent = indexed_ ? triangles_.share() : current_->triangles;
    current_ = deformation_.next(current_, std::move(asSent), vertices_.share(), now);
    hasDeformed_ = true;
  }
  dirty_ = false;
  shapeChanged_ = false;
  finished_ = false;
  wasPublished_ = false;
  return current_;
}

Nanos MeshDraft::travel(Nanos begin, const std::function<Nanos(double)>& shortest) const {
  if (!current_ || !current_->target) return 0;
  const Nanos least = std::max<Nanos>(1'000'000, shortest(deformation_.way()));
  const Nanos gap = begin - lastCommit_;
  const Nanos interval = gap > kLongestGap ? kUnmeasured : gap;
  return std::clamp(interval, std::min(least, kLongestMorph), kLongestMorph);
}

void MeshDraft::begin(Nanos begin, Nanos travel) {
  lastCommit_ = begin;
  if (current_ && current_->target) deformation_.begin(*current_, begin, begin + travel);
}

}  // namespace hapticd::scene
