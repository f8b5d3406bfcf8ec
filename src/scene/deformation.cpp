#include "scene/deformation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

namespace hapticd::scene {
namespace {

// The bounds of a refitted tree get looser from shape to shape.
constexpr int kRefitsBeforeRebuild = 64;

std::vector<std::uint32_t> loneOf(const std::vector<Triangle>& triangles, std::size_t vertices) {
  std::vector<bool> used(vertices);
  for (const Triangle& t : triangles) {
    if (std::max({t[0], t[1], t[2]}) >= vertices) continue;
    for (const std::uint32_t corner : t) used[corner] = true;
  }
  std::vector<std::uint32_t> lone;
  for (std::uint32_t i = 0; i < vertices; ++i) {
    if (!used[i]) lone.push_back(i);
  }
  return lone;
}

// Of the corners of triangles. `lone` ascends.
Box boundsOf(const std::vector<Vec3f>& vertices, const std::vector<std::uint32_t>& lone) {
  geometry::Vec3f lower = Vec3f::Constant(std::numeric_limits<float>::infinity());
  geometry::Vec3f upper = -lower;
  auto skip = lone.begin();
  for (std::uint32_t i = 0; i < vertices.size(); ++i) {
    if (skip != lone.end() && *skip == i) {
      ++skip;
      continue;
    }
    lower = lower.cwiseMin(vertices[i]);
    upper = upper.cwiseMax(vertices[i]);
  }
  return {lower.cast<double>(), upper.cast<double>()};
}

// The coordinates of all vertices.
const float* flat(const std::vector<Vec3f>& vertices) {
  return vertices.data()->data();
}

// MeshGeometry::vertex() at `now`, for all vertices.
void placesOf(const MeshGeometry& mesh, Nanos now, float* out) {
  const float* const from = flat(*mesh.vertices);
  const float* const to = flat(*mesh.target);
  const double progress = mesh.progress(now);
  for (std::size_t i = 0; i < 3 * mesh.target->size(); ++i) {
    const double begin = from[i];
    out[i] = static_cast<float>(begin + progress * (to[i] - begin));
  }
}

}  // namespace

void IndexBuilder::start(std::function<SpatialIndex()> build) {
  job_ = std::make_shared<Job>();
  job_->build = std::move(build);
  thread_ = base::Thread({.name = "index builder"}, [job = job_]() -> std::optional<Nanos> {
    if (job->done) return std::nullopt;  // the last step of a thread that has built it
    try {
      job->index = job->build();
    } catch (...) {
      job->error = std::current_exception();
    }
    job->done = true;
    return std::nullopt;
  });
}

std::optional<SpatialIndex> IndexBuilder::takeIfBuilt() {
  if (!job_ || !job_->done) return std::nullopt;
  thread_.stop();
  const auto job = std::exchange(job_, nullptr);
  if (job->error) std::rethrow_exception(job->error);
  return std::move(job->index);
}

void Deformation::restart() {
  *this = {};
}

// The rest of the old trajectory and all of the new one.
void Deformation::sweep(const MeshGeometry& old, const std::vector<Vec3f>& target, Nanos now) {
  const auto count = static_cast<Eigen::Index>(3 * target.size());
  sweep_.lower.resize(3 * target.size() + 1);
  sweep_.upper.resize(3 * target.size() + 1);
  Eigen::Map<Eigen::ArrayXf> lower(sweep_.lower.data(), count);
  Eigen::Map<Eigen::ArrayXf> upper(sweep_.upper.data(), count);
  const Eigen::Map<const Eigen::ArrayXf> a(flat(old.target ? *old.target : *old.vertices), count);
  const Eigen::Map<const Eigen::ArrayXf> b(flat(target), count);
  if (old.deformingAfter(now)) {
    placesOf(old, now, upper.data());
    lower = upper.min(a).min(b);
    upper = upper.max(a).max(b);
  } else {
    lower = a.min(b);
    upper = a.max(b);
  }
  leaveOutLoneVertices();
}

void Deformation::leaveOutLoneVertices() {
  for (const std::uint32_t i : lone_) {
    std::fill_n(sweep_.lower.begin() + 3 * std::ptrdiff_t{i}, 3, std::numeric_limits<float>::max());
    std::fill_n(sweep_.upper.begin() + 3 * std::ptrdiff_t{i}, 3, std::numeric_limits<float>::lowest());
  }
}

// The tick before saw the old shape at any place of its trajectory: boxes cover all of that, too.
void Deformation::coverTrajectory(const MeshGeometry& old) {
  if (!old.target) return;
  const auto count = static_cast<Eigen::Index>(sweep_.lower.size() - 1);
  Eigen::Map<Eigen::ArrayXf> lower(sweep_.lower.data(), count);
  Eigen::Map<Eigen::ArrayXf> upper(sweep_.upper.data(), count);
  const Eigen::Map<const Eigen::ArrayXf> from(flat(*old.vertices), count);
  lower = lower.min(from);
  upper = upper.max(from);
  leaveOutLoneVertices();
}

double Deformation::Moves::add(double move, Nanos now) {
  constexpr Nanos kLength = 100'000'000;
  if (now - begin > kLength) {
    older = now - begin > 2 * kLength ? 0 : recent;
    recent = 0;
    begin = now;
  }
  recent += move;
  return recent + older;
}

// Upper bound of the way of a vertex to the new shape.
double Deformation::longestMove() const {
  const auto count = static_cast<Eigen::Index>(sweep_.lower.size() - 1);
  if (count <= 0) return 0;
  const Eigen::Map<const Eigen::ArrayXf> lower(sweep_.lower.data(), count);
  const Eigen::Map<const Eigen::ArrayXf> upper(sweep_.upper.data(), count);
  return std::max(0.0, std::sqrt(3.0) * static_cast<double>((upper - lower).maxCoeff()));
}

bool Deformation::spareIsFree() const {
  // use_count() == 1: this is the only reference, so nobody else can acquire one.
  if (!spare_ || spare_.use_count() != 1) return false;
  std::atomic_thread_fence(std::memory_order_acquire);
  return true;
}

// A tree with many refits stays in use while a new one is built. The moment of the exchange changes no force:
// an index only proposes candidates.
SpatialIndex Deformation::indexOver(const std::shared_ptr<const std::vector<Triangle>>& triangles) {
  const auto boxed = [](const std::vector<Triangle>& all, const Sweep& sweep) {
    return BoxedTriangles{all, sweep.lower, sweep.upper};
  };
  if (!spareIsFree()) return SpatialIndex::build(boxed(*triangles, sweep_));
  SpatialIndex index = std::move(spare_->index);
  if (index.refits() >= kRefitsBeforeRebuild) {
    if (!rebuild_.running()) {
      rebuild_.start([=, sweep = sweep_] { return SpatialIndex::build(boxed(*triangles, sweep)); });
    } else if (auto rebuilt = rebuild_.takeIfBuilt()) {
      index = std::move(*rebuilt);
    }
  }
  index.refit(boxed(*triangles, sweep_));
  return index;
}

// As if the surface were spread over its bounds: how many boxes there are around a place of it.
bool Deformation::boxesAreAroundEachOther(const Box& bounds) const {
  constexpr double kFew = 512;
  const auto count = static_cast<Eigen::Index>(sweep_.lower.size() - 1);
  const Eigen::Map<const Eigen::ArrayXf> lower(sweep_.lower.data(), count);
  const Eigen::Map<const Eigen::ArrayXf> upper(sweep_.upper.data(), count);
  const double extent = bounds.extents().maxCoeff();
  return static_cast<double>((upper - lower).max(0).square().sum()) > kFew * extent * extent;
}

// A mesh that leapt may rest for long. A tick would spend its work on what the boxes around all ways propose.
SpatialIndex Deformation::indexOfArrived(const std::vector<Triangle>& triangles,
                                         const std::vector<Vec3f>& target) {
  std::copy_n(flat(target), 3 * target.size(), sweep_.lower.begin());
  std::copy_n(flat(target), 3 * target.size(), sweep_.upper.begin());
  leaveOutLoneVertices();
  SpatialIndex index = spareIsFree() ? std::move(spare_->indexOfArrived) : SpatialIndex();
  if (index.refits() >= kRefitsBeforeRebuild) index = {};
  index.refit({triangles, sweep_.lower, sweep_.upper});
  return index;
}

std::shared_ptr<MeshGeometry> Deformation::next(std::shared_ptr<MeshGeometry> old,
                                                std::shared_ptr<const std::vector<Triangle>> triangles,
                                                std::shared_ptr<const std::vector<Vec3f>> target, Nanos now) {
  if (!begun_) lone_ = loneOf(*triangles, target->size());
  begun_ = true;
  auto mesh = std::make_shared<MeshGeometry>();
  mesh->topology = old->topology;
  mesh->triangles = old->triangles;
  sweep(*old, *target, now);
  way_ = longestMove();
  coverTrajectory(*old);
  mesh->index = indexOver(triangles);
  mesh->bounds = boundsOf(*target, lone_);
  if (boxesAreAroundEachOther(mesh->bounds)) mesh->indexOfArrived = indexOfArrived(*triangles, *target);
  mesh->boundsOnTheWay = old->boundsAfter(now);
  mesh->boundsOnTheWay.extend(mesh->bounds);
  mesh->target = std::move(target);
  mesh->before = old->target ? old->target : old->vertices;
  mesh->vertices = mesh->before;
  mesh->shape = old->shape + 1;
  from_ = old->deformingAfter(now) ? std::make_shared<std::vector<Vec3f>>(mesh->target->size()) : nullptr;
  spare_ = std::move(old);
  return mesh;
}

void Deformation::begin(MeshGeometry& mesh, Nanos begin, Nanos end) {
  if (from_) {
    placesOf(*spare_, begin, from_->data()->data());
    mesh.vertices = std::move(from_);
  }
  mesh.morphBegin = begin;
  mesh.morphEnd = end;
  mesh.recentMove = moves_.add(way_, begin);
}

}  // namespace hapticd::scene
