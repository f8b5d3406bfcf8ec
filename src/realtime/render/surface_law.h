// The contact law: from the contact set of the proxy to the force on the HIP.
#pragma once

#include <array>

#include "realtime/render/proxy.h"
#include "realtime/render/renderer.h"
#include "realtime/render/yielding.h"

namespace hapticd::realtime {

/// Of each face along its normal, by spring and damper, newtons. The damper may reduce the force, but the
/// surface never pulls. noexcept, no allocation.
std::array<double, kMaxActive> normalForces(const ContactSet& contactSet, const Springs& springs,
                                            const Vec3& hipVelocity_m_per_s) noexcept;

/// Fills the contact part of `out` (force, normal, depth, contacts). Device frame, SI. noexcept, no
/// allocation.
void applySurfaceLaw(const ContactSet& contactSet, const Springs& springs, const Vec3& proxy_m,
                     const Vec3& hipVelocity_m_per_s, double toolRadius_m, Rendering& out) noexcept;

/// Adds the adhesive force of planes. Call it after applySurfaceLaw().
void applyAdhesion(const Adhesion& adhesion, Rendering& out) noexcept;

}  // namespace hapticd::realtime
