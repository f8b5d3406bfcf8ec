// Bounding-box tree over numbered boxes (Embree), for triangles of a mesh and for objects of a scene.
//
// It only proposes: every box is padded by more than the float error of the tree, so each query visits a
// superset of the boxes it touches. The caller decides in double precision and breaks ties by the lowest
// id, because the order of visits is not defined.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "geometry/triangle_mesh.h"
#include "geometry/types.h"

namespace hapticd::scene {

using geometry::Box;
using geometry::Triangle;
using geometry::Vec3;

/// Triangles with a box for each corner, which a triangle's box is around. A triangle with a number beyond
/// the corners is left out; corners of no triangle count for the bounds.
struct BoxedTriangles {
  std::span<const Triangle> triangles;
  /// Three coordinates for each corner and one more, because they are read four at a time. Finite.
  std::span<const float> lower, upper;

  std::size_t cornerCount() const noexcept { return lower.size() / 3; }
  /// Empty when the triangle is left out.
  Box boxOf(std::uint32_t triangle) const noexcept;
};

/// Tree over boxes 0…n-1. Building and refitting allocate (scene thread); queries are const, noexcept,
/// lock-free and allocation-free, and may run while other threads query the same index.
class SpatialIndex {
 public:
  /// Gives the box of an id; an empty box, or one that is not finite, leaves the id out of the tree. Called
  /// from several threads, and more than once.
  using BoxOf = std::function<Box(std::uint32_t id)>;

  SpatialIndex() noexcept;
  ~SpatialIndex();
  SpatialIndex(SpatialIndex&&) noexcept;
  SpatialIndex& operator=(SpatialIndex&&) noexcept;

  /// Builds over ids 0…count-1. Throws std::runtime_error with Embree's error text.
  static SpatialIndex build(std::uint32_t count, const BoxOf& boxOf);
  static SpatialIndex build(const BoxedTriangles& all);

  /// Recomputes all boxes and refits the tree in place, many times faster than building it; nobody may query
  /// meanwhile. Over the same triangles as built. For boxes that moved a little: a refitted tree gets slower
  /// to query.
  void refit(const BoxedTriangles& all);
  /// How often it was refitted since it was built.
  int refits() const noexcept { return refits_; }

  /// Box around all boxes, the same whether built or refitted; empty when there is none.
  const Box& bounds() const noexcept { return bounds_; }
  std::uint32_t size() const noexcept { return count_; }

  /// Calls visit(id) for at least every box within `radius` of `centre`; a visit that returns false is the
  /// last one.
  template <class Visit>
  void visitNear(const Vec3& centre, double radius, Visit&& visit) const noexcept {
    visitNearImpl(
        centre, radius,
        [](void* v, std::uint32_t id) noexcept -> bool {
          auto& call = *static_cast<std::remove_reference_t<Visit>*>(v);
          if constexpr (std::is_void_v<decltype(call(id))>) {
            call(id);
            return true;
          } else {
            return call(id);
          }
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(visit))));
  }

  /// As visitNear(), roughly near to far, with a radius that shrinks: visit returns the radius beyond which
  /// nothing more is wanted, 0 or less to end.
  template <class Visit>
  void visitNearest(const Vec3& centre, double radius, Visit&& visit) const noexcept {
    visitNearestImpl(
        centre, radius,
        [](void* v, std::uint32_t id) noexcept -> double {
          return (*static_cast<std::remove_reference_t<Visit>*>(v))(id);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(visit))));
  }

  /// Calls visit(id) for at least every box that the segment touches, roughly near to far. visit returns the
  /// segment parameter in [0,1] beyond which nothing more is wanted (1 to go on, the hit parameter after a
  /// hit).
  template <class Visit>
  void visitSegment(const Vec3& from, const Vec3& to, Visit&& visit) const noexcept {
    visitSegmentImpl(
        from, to,
        [](void* v, std::uint32_t id) noexcept -> double {
          return (*static_cast<std::remove_reference_t<Visit>*>(v))(id);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(visit))));
  }

 private:
  using NearThunk = bool (*)(void*, std::uint32_t) noexcept;
  using SegmentThunk = double (*)(void*, std::uint32_t) noexcept;
  bool isWithin(double radius, const Vec3& centre) const noexcept;
  void visitNearImpl(const Vec3& centre, double radius, NearThunk thunk, void* visitor) const noexcept;
  void visitNearestImpl(const Vec3& centre, double radius, SegmentThunk thunk, void* visitor) const noexcept;
  void visitSegmentImpl(const Vec3& from, const Vec3& to, SegmentThunk thunk, void* visitor) const noexcept;

  struct Tree;
  std::unique_ptr<Tree> tree_;
  Box bounds_;
  double pad_ = 0;
  std::uint32_t count_ = 0;
  int refits_ = 0;
};

}  // namespace hapticd::scene
