// Meshes, scenes and hands that the benchmarks share. All of it is made in code and the same on every
// machine.
#pragma once

#include <memory>
#include <vector>

#include "base/time.h"
#include "geometry/triangle_mesh.h"
#include "scene/builder.h"
#include "scene/snapshot.h"

namespace hapticd::bench {

using geometry::Vec3;
using geometry::Vec3f;

inline constexpr double kBallRadius_mm = 30;

/// A ball with bumps of 0.6 mm, about that many triangles (a sixth of a millimetre wide at a million), in
/// millimetres, fronts out.
geometry::TriangleMesh makeBumpyBall(std::size_t triangles, double radius_mm = kBallRadius_mm);
/// The same, made once.
const geometry::TriangleMesh& bumpyBall(std::size_t triangles);
/// Distance of the ball's surface from its centre in this direction, mm.
double ballSurface_mm(const Vec3& direction, double radius_mm = kBallRadius_mm);

/// What a client would say to put a mesh into an object, with a surface of half the reference stiffness.
void tell(scene::SceneBuilder& builder, std::int32_t object, const geometry::TriangleMesh& mesh,
          base::Nanos now);
/// A scene of this one mesh, as the server would show it.
std::shared_ptr<const scene::SceneSnapshot> sceneOf(const geometry::TriangleMesh& mesh);

/// What the hand does; `way` is through the air from one to the next, and is not measured.
enum class Act { contact, slide, tap, way };
inline constexpr Act kActs[] = {Act::contact, Act::slide, Act::tap};
const char* nameOf(Act act) noexcept;

/// Where the hand is at time t on the ball, device metres: pressed 1.5 mm in with the tremor of a hand; the
/// same while it slides at 60 mm/s; four taps a second, 2 mm in, each a little farther.
Vec3 handAt(Act act, double t_s);
/// One tick of a hand at 1 kHz.
struct HandTick {
  Act act;
  Vec3 position_m;
};
/// Rounds of a second of each act, with ways between; begins in the air, and the end leads back there.
std::vector<HandTick> handOf(int rounds);

}  // namespace hapticd::bench
