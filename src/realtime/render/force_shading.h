// Force shading: the direction of a face's force varies smoothly from corner to corner, as in Phong shading
// (Morgenbesser & Srinivasan 1996). The magnitude and the proxy do not change.
#pragma once

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {

/// Unit direction of the force at point `at` of a touched triangle, device frame: the corner normals with
/// barycentric weights. A corner normal is the mean of the faces around it, weighted by their angles, without
/// faces beyond a sharp edge. `touched` is what holds the tool: at an edge, its anchor is there. noexcept, no
/// allocation.
Vec3 shadedNormal(const PlacedObject& object, std::uint32_t triangle, Nanos now, const HalfSpace& touched,
                  const Vec3& at) noexcept;

}  // namespace hapticd::realtime
