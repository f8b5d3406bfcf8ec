// From a scene and a hand to a force: the god-object proxy, the law of the touched surface, the effects.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "base/time.h"
#include "device/device.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using geometry::Affine;
using base::Nanos;
using geometry::Vec3;

inline constexpr int kMaxContacts = 4;  ///< three faces hold, and a plane may pull

/// One object that pushes the hand in this tick; planes of the scene count as one. Device frame, metres,
/// newtons.
struct Contact {
  std::int32_t object = -1;     ///< its id; -1: planes of the scene
  std::uint32_t triangle = 0;   ///< that pushes hardest
  Vec3 point_m = Vec3::Zero();  ///< on that triangle
  Vec3 normal = Vec3::Zero();   ///< of that triangle, unit
  Vec3 force_N = Vec3::Zero();  ///< on the hand
};

/// What the hand feels in one tick. Device frame, metres, newtons.
struct Rendering {
  Vec3 proxy_m = Vec3::Zero();
  Vec3 force_N = Vec3::Zero();         ///< contact plus effects, before the guard
  Vec3 contactForce_N = Vec3::Zero();  ///< contact alone
  Vec3 normalForce_N = Vec3::Zero();   ///< its part along the normal, for force_report = normal
  bool touching = false;
  std::int32_t touchedObject = -1;  ///< the one that pushes hardest
  double depth_m = 0;
  Vec3 normal = Vec3::Zero();  ///< unit, out of the surface; zero when free
  Vec3 scp_m = Vec3::Zero();   ///< surface contact point; the proxy less the tool radius
  std::uint32_t contactCount = 0;
  std::array<Contact, kMaxContacts> contacts;  ///< one for each touched object; they sum to contactForce_N
  std::uint32_t status = 0;                    ///< RenderStatus bits
};

enum RenderStatus : std::uint32_t {
  kRenderIterationLimit =
      1U << 0,  ///< the proxy was still moving when the tick's budget ended; it goes on next tick
  kRenderCandidateLimit = 1U << 1,  ///< more triangles near the proxy than the tick can hold
  kRenderNotFinite = 1U << 2,       ///< a value was not finite; the force of this tick is zero
  kRenderGeometryJump = 1U << 3,    ///< geometry under the hand changed by a jump; the guard blends the force
  kRenderReleased = 1U << 4,        ///< contact given up until the hand leaves (deep first contact)
  kRenderPopthrough = 1U << 5,
};

/// Choices of the operator, fixed while the loop runs.
struct RenderOptions {
  double toolRadius_m = 0;
  bool forceShading = false;
};

/// Holds the proxy from tick to tick. Constructed outside the loop; step() is realtime: noexcept, no
/// allocation, no lock. One per servo; not thread-safe.
class Renderer {
 public:
  explicit Renderer(const RenderOptions& options = {});
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// One tick at time `now`, `period` after the one before. `scene` must stay alive until the next step's
  /// end.
  void step(const scene::SceneSnapshot& scene, const device::DeviceState& device, Nanos now, Nanos period,
            Rendering& out) noexcept;

  /// Forgets the proxy: the next step starts free at the hand.
  void reset() noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace hapticd::realtime
