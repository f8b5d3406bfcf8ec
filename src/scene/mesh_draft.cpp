#include "scene/mesh_draft.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>

namespace hapticd::scene {
namespace {

constexpr float kNotYet = std::numeric_limits<float>::quiet_NaN();
constexpr std::uint32_t kNoVertex = 0xFFFFFFFF;
constexpr Triangle kNoTriangle{kNoVertex, kNoVertex, kNoVertex};
constexpr int kRefitsBeforeRebuild = 64;

// Numbers are never used again, by whichever mesh.
std::uint64_t newTopology() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

bool allFinite(const std::vector<Vec3f>& run) {
  bool finite = true;
  for (const Vec3f& v : run) finite &= std::isfinite(v.x()) && std::isfinite(v.y()) && std::isfinite(v.z());
  return finite;
}

bool sameBytes(const Vec3f* a, const std::vector<Vec3f>& b) {
  return std::memcmp(a, b.data(), b.size() * sizeof(Vec3f)) == 0;
}

// A corner that is not a number leaves the triangle out. In floats as far as that is exact: it is asked for
// each triangle of a mesh, again and again.
Box boxOfTriangle(const Triangle& t, const std::vector<Vec3f>& vertices) {
  if (t[0] >= vertices.size() || t[1] >= vertices.size() || t[2] >= vertices.size()) return {};
  const Vec3f& a = vertices[t[0]];
  const Vec3f& b = vertices[t[1]];
  const Vec3f& c = vertices[t[2]];
  // What is not a number or infinite stays so when it is taken times 0.
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

std::optional<Nanos> MeshDraft::due() const {
  if (!dirty_) return std::nullopt;
  if (finished_) return lastEdit_;
  // Positions alone are a surface that moves: there is nothing incomplete to wait for but the rest of a
  // frame.
  if (!shapeChanged_) return std::min(lastEdit_ + kPause, firstEdit_ + kQuiet);
  return std::min(lastEdit_ + kQuiet, firstEdit_ + kLongest);
}

void MeshDraft::grow(std::vector<Vec3f>& vertices, std::size_t size) {
  sparse_ = true;
  vertices.resize(size, Vec3f::Constant(kNotYet));
}

std::size_t MeshDraft::setVertices(std::uint32_t first, std::vector<Vec3f>&& run, Nanos now) {
  const std::size_t end = first + run.size();
  const std::size_t before = vertexCount();
  const bool inPlace = end <= before;
  if (inPlace && sameBytes(vertices_.read().data() + first, run)) return 0;
  std::size_t refused = 0;
  const bool finite = allFinite(run);
  if (!finite && std::none_of(run.begin(), run.end(), [](const Vec3f& v) { return v.allFinite(); })) {
    return run.size();
  }
  std::vector<Vec3f>& vertices = vertices_.write(end);
  if (finite && before == 0 && first == 0) {
    vertices = std::move(run);
  } else if (finite) {
    if (first > before) grow(vertices, first);
    const std::size_t overlap = std::min<std::size_t>(run.size(), vertices.size() - first);
    std::copy_n(run.begin(), overlap, vertices.begin() + first);
    vertices.insert(vertices.end(), run.begin() + static_cast<std::ptrdiff_t>(overlap), run.end());
  } else {
    if (end > before) grow(vertices, end);
    for (std::size_t i = 0; i < run.size(); ++i) {
      if (run[i].allFinite()) {
        vertices[first + i] = run[i];
      } else {
        ++refused;
      }
    }
  }
  shapeChanged_ |= !inPlace || sparse_;
  edited(now);
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
  shapeChanged_ = true;
  edited(now);
}

bool MeshDraft::removeTriangle(std::uint32_t triangle, Nanos now) {
  if (!indexed_ || triangle >= triangles_.read().size() || triangles_.read()[triangle] == kNoTriangle)
    return false;
  triangles_.write(0)[triangle] = kNoTriangle;
  shapeChanged_ = true;
  edited(now);
  return true;
}

void MeshDraft::clear(Nanos now) {
  vertices_ = {};
  triangles_ = {};
  indexed_ = false;
  sparse_ = false;
  shapeChanged_ = true;
  edited(now);
  finished_ = true;
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

std::shared_ptr<MeshGeometry> MeshDraft::build() {
  auto mesh = std::make_shared<MeshGeometry>();
  mesh->topology = newTopology();
  mesh->vertices = vertices_.share();
  mesh->triangles = shareTriangles();
  const std::vector<Vec3f>& vertices = *mesh->vertices;
  // The list as sent tells which triangles lack a corner; the published one has others in their place.
  const std::vector<Triangle>& triangles = indexed_ ? triangles_.read() : *mesh->triangles;
  mesh->index = SpatialIndex::build(static_cast<std::uint32_t>(triangles.size()),
                                    [&](std::uint32_t id) { return boxOfTriangle(triangles[id], vertices); });
  refits_ = 0;
  return mesh;
}

SpatialIndex MeshDraft::refitOrBuild(std::uint32_t count, const SpatialIndex::BoxOf& boxOf) {
  // Nobody can get hold of a geometry again that only the draft knows.
  const bool free =
      spare_ && spare_.use_count() == 1 && spare_->index.size() == count && refits_ < kRefitsBeforeRebuild;
  if (!free) {
    if (spare_) refits_ = 0;
    return SpatialIndex::build(count, boxOf);
  }
  std::atomic_thread_fence(std::memory_order_acquire);
  ++refits_;
  SpatialIndex index = std::move(spare_->index);
  index.refit(boxOf);
  return index;
}

// The surface travels from where it is felt now to where the client wants it. Boxes hold all of the way: what
// is left of the old one and the new end.
std::shared_ptr<MeshGeometry> MeshDraft::morph(const std::function<Nanos()>& clock) {
  const MeshGeometry& old = *current_;
  const Nanos now = clock();
  auto mesh = std::make_shared<MeshGeometry>();
  mesh->topology = old.topology;
  mesh->triangles = old.triangles;
  mesh->target = vertices_.share();
  const std::vector<Vec3f>& target = *mesh->target;
  const std::vector<Triangle>& triangles = indexed_ ? triangles_.read() : *mesh->triangles;
  // Where each vertex is now, once and not for each of its triangles.
  const bool deforming = old.deformingAfter(now);
  std::vector<Vec3> places(deforming ? target.size() : 0);
  for (std::uint32_t i = 0; i < places.size(); ++i) places[i] = old.vertex(i, now);
  const std::vector<Vec3f>& before = old.target ? *old.target : *old.vertices;
  mesh->index = refitOrBuild(static_cast<std::uint32_t>(triangles.size()), [&](std::uint32_t id) {
    Box box = boxOfTriangle(triangles[id], target);
    if (box.empty()) return box;
    box.extend(boxOfTriangle(triangles[id], before));
    if (!deforming) return box;
    for (const std::uint32_t corner : triangles[id]) box.extend(places[corner]);
    return box;
  });

  const Nanos begin = clock();
  if (old.deformingAfter(begin)) {
    auto from = std::make_shared<std::vector<Vec3f>>(target.size());
    for (std::uint32_t i = 0; i < from->size(); ++i) (*from)[i] = old.vertex(i, begin).cast<float>();
    mesh->vertices = from;
  } else {
    mesh->vertices = old.target ? old.target : old.vertices;
  }
  mesh->morphBegin = begin;
  mesh->morphEnd = begin + std::clamp<Nanos>(begin - lastCommit_, 1'000'000, kLongestMorph);
  return mesh;
}

std::shared_ptr<const MeshGeometry> MeshDraft::commit(const std::function<Nanos()>& clock) {
  std::shared_ptr<MeshGeometry> mesh;
  if (triangleCount() > 0) mesh = current_ && !shapeChanged_ ? morph(clock) : build();
  spare_ = std::exchange(current_, std::move(mesh));
  if (!current_ || !spare_ || spare_->topology != current_->topology) spare_.reset();
  dirty_ = false;
  shapeChanged_ = false;
  finished_ = false;
  lastCommit_ = clock();
  return current_;
}

}  // namespace hapticd::scene
