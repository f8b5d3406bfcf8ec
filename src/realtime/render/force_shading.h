// Force shading: the force of a face turns smoothly from corner to corner, as light does on a shaded one
// (Morgenbesser & Srinivasan 1996). Its size and the proxy stay as they are.
#pragma once

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {

/// The direction of the force at point `at` of a touched triangle, device frame: the corner normals, each the
/// mean of the faces around it by their angles, weighted by nearness. Faces beyond a sharp edge do not count.
/// `normal` is the face's own, on the touched side.
Vec3 shadedNormal(const PlacedObject& object, std::uint32_t triangle, Nanos now, const Vec3& normal,
                  const Vec3& at) noexcept;

}  // namespace hapticd::realtime
