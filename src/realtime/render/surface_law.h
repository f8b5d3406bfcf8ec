// The law of the touched surfaces: from what holds the proxy to the force on the hand.
#pragma once

#include "realtime/render/proxy.h"
#include "realtime/render/renderer.h"

namespace hapticd::realtime {

/// Fills the contact part of `out` (force, normal, depth, contacts). `hipVelocity` in the device frame.
void applySurfaceLaw(const ContactSet& contactSet, const Vec3& proxy_m, const Vec3& hipVelocity_m_per_s,
                     double toolRadius_m, Rendering& out) noexcept;

/// Adds the pull of planes that hold on to the hand. After applySurfaceLaw.
void applyAdhesion(const Vec3& force_N, Rendering& out) noexcept;

}  // namespace hapticd::realtime
