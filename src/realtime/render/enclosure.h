// Whether a surface is around a point. Only for objects that appear around the tool: the proxy itself needs
// no inside.
#pragma once

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {

/// Visits to triangles that the tests of one tick may make; a ray counts as kRayVisits more. An object whose
/// test exceeds it counts as enclosing, which exerts no force.
struct EnclosureBudget {
  static constexpr int kRayVisits = 16;  ///< the way of a ray through a tree takes as long
  int visits = 16384;
};

/// True when the tool at p (device metres) is inside a closed surface of the object, or its ball intersects
/// the surface. Open surfaces do not enclose: each of 64 rays must cross the surface more often in one
/// direction than in the other. When one side of the faces can be touched, the point must be behind them: a
/// room whose walls face inwards does not enclose a tool in it.
bool encloses(const PlacedObject& object, scene::TouchableFaces faces, Nanos now, const Vec3& p,
              double toolRadius_m, EnclosureBudget& budget) noexcept;

/// True when the tool at p touches nothing of the object and is neither inside it nor on one side of an open
/// surface: on all but one of 64 rays as many fronts as backs are met, or nothing.
bool isClear(const PlacedObject& object, Nanos now, const Vec3& p, double toolRadius_m,
             EnclosureBudget& budget) noexcept;

/// True when the tool has left an object that enclosed it: most of the rays agree, and the ball is free.
bool hasLeft(const PlacedObject& object, scene::TouchableFaces faces, Nanos now, const Vec3& p,
             double toolRadius_m, EnclosureBudget& budget) noexcept;

}  // namespace hapticd::realtime
