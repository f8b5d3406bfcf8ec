// The contact law: from the contact set of the proxy to the force on the HIP.
#pragma once

#include "realtime/render/proxy.h"
#include "realtime/render/renderer.h"

namespace hapticd::realtime {

/// Fills the contact part of `out` (force, normal, depth, contacts). Device frame, SI. noexcept, no
/// allocation.
void applySurfaceLaw(const ContactSet& contactSet, const Vec3& proxy_m, const Vec3& hipVelocity_m_per_s,
                     double toolRadius_m, Rendering& out) noexcept;

/// A ball that overlaps a face whose popthrough force is exceeded: the face pushes with that force until the
/// ball has room behind it.
bool isYielding(const ContactConstraint& constraint, double stiffness_N_per_m, double toolRadius_m) noexcept;

/// Adds the adhesive force of planes. Call it after applySurfaceLaw().
void applyAdhesion(const Adhesion& adhesion, Rendering& out) noexcept;

}  // namespace hapticd::realtime
