#include "scene/deformation.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <utility>

namespace hapticd::scene {
namespace {

// A refitted tree gets worse from shape to shape.
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

// Coordinates of vertices in a row.
const float* flat(const std::vector<Vec3f>& vertices) {
  return vertices.data()->data();
}

// As MeshGeometry::vertex() on the way, for all of them.
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

void Deformation::restart() {
  *this = {};
}

// Boxes hold what is left of the old way and all of the new one.
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
  for (const std::uint32_t i : lone_) {
    lower.segment<3>(3 * Eigen::Index{i}).setConstant(std::numeric_limits<float>::max());
    upper.segment<3>(3 * Eigen::Index{i}).setConstant(std::numeric_limits<float>::lowest());
  }
}

bool Deformation::spareIsFree() const {
  // Nobody can get hold of a geometry again that only this knows.
  if (!spare_ || spare_.use_count() != 1) return false;
  std::atomic_thread_fence(std::memory_order_acquire);
  return true;
}

// A tree that has become old serves on while another is built beside it.
SpatialIndex Deformation::indexOver(const std::shared_ptr<const std::vector<Triangle>>& triangles) {
  const auto boxed = [](const std::vector<Triangle>& all, const Sweep& sweep) {
    return BoxedTriangles{all, sweep.lower, sweep.upper};
  };
  if (!spareIsFree()) return SpatialIndex::build(boxed(*triangles, sweep_));
  SpatialIndex index = std::move(spare_->index);
  if (index.refits() >= kRefitsBeforeRebuild) {
    if (!rebuilt_.valid()) {
      rebuilt_ = std::async([=, sweep = sweep_] { return SpatialIndex::build(boxed(*triangles, sweep)); });
    } else if (rebuilt_.wait_for(std::chrono::seconds(0)) != std::future_status::timeout) {
      index = rebuilt_.get();
    }
  }
  index.refit(boxed(*triangles, sweep_));
  return index;
}

std::shared_ptr<MeshGeometry> Deformation::next(std::shared_ptr<MeshGeometry> old,
                                                std::shared_ptr<const std::vector<Triangle>> triangles,
                                                std::shared_ptr<const std::vector<Vec3f>> target,
                                                const std::function<Nanos()>& clock, Nanos before,
                                                Nanos longest) {
  if (!begun_) lone_ = loneOf(*triangles, target->size());
  begun_ = true;
  auto mesh = std::make_shared<MeshGeometry>();
  mesh->topology = old->topology;
  mesh->triangles = old->triangles;
  sweep(*old, *target, clock());
  mesh->index = indexOver(triangles);
  mesh->target = std::move(target);

  const Nanos begin = clock();
  if (old->deformingAfter(begin)) {
    auto from = std::make_shared<std::vector<Vec3f>>(mesh->target->size());
    placesOf(*old, begin, from->data()->data());
    mesh->vertices = std::move(from);
  } else {
    mesh->vertices = old->target ? old->target : old->vertices;
  }
  mesh->morphBegin = begin;
  mesh->morphEnd = begin + std::clamp<Nanos>(begin - before, 1'000'000, longest);
  spare_ = std::move(old);
  return mesh;
}

}  // namespace hapticd::scene
