// One stiffness where surfaces of unequal stiffness are near each other.
//
// The spring between the HIP h and the proxy p stores U = 1/2 kappa |p - h|^2, and the force is its gradient:
// without friction and damping no closed path of the HIP gains energy. kappa is the stiffness of the touched
// surface, blended with that of unequal surfaces within a width w >= 1 mm that grows with the depth. A force
// sum K_i d_i n_i has a curl where unequal surfaces meet at an angle.
#pragma once

#include "realtime/render/contact_query.h"

namespace hapticd::realtime {

struct ContactSet;

/// The spring at a proxy: force = stiffness * (proxy - HIP) + slope + turn.
struct BlendedSpring {
  double stiffness_N_per_m = 0;  ///< kappa, and its growth with the depth
  double kappa_N_per_m = 0;      ///< kappa: the spring stores 1/2 kappa |p - h|^2
  Vec3 slope_N = Vec3::Zero();   ///< along the contact set, towards softer places
  Vec3 turn_N = Vec3::Zero();    ///< across an edge: from a surface that the touched faces hide partly
  bool rests = true;             ///< false: what takes part in it moves or deforms, or did lately
  bool complete = true;          ///< false: more surfaces or triangles near the proxy than are searched
};

/// The spring of a contact set that touches something. With one stiffness within the width it is that
/// stiffness, to the bit. What the query leaves out takes no part. |force| <= largest stiffness * depth.
/// noexcept, no allocation; bounded by counts.
BlendedSpring blendedSpring(const SceneAtTime& now, const ContactQuery& query, const PlacedPlanes& planes,
                            double toolRadius_m, const Vec3& proxy, const ContactSet& contactSet) noexcept;

/// How far from the proxy the surfaces are that take part, to the centre of a ball.
double blendReach(double toolRadius_m, const ContactSet& contactSet) noexcept;

}  // namespace hapticd::realtime
