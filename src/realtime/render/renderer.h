// From a scene and a device state to a force: god-object proxy, contact law, effects.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>

#include "base/time.h"
#include "device/device.h"
#include "realtime/render/memory.h"
#include "realtime/render/pressed_faces.h"
#include "scene/snapshot.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Affine;
using geometry::Vec3;

inline constexpr int kMaxContacts = 4;  ///< three faces and one adhesive plane

/// One object in contact in this tick; all planes of the scene count as one. Device frame, metres, newtons.
struct Contact {
  std::int32_t object = -1;     ///< id; -1: planes of the scene
  std::uint32_t triangle = 0;   ///< the one with the largest force
  Vec3 point_m = Vec3::Zero();  ///< on that triangle
  Vec3 normal = Vec3::Zero();   ///< of that triangle, unit
  Vec3 force_N = Vec3::Zero();  ///< on the HIP
};

/// The result of one tick. Device frame, metres, newtons.
struct Rendering {
  Vec3 proxy_m = Vec3::Zero();
  Vec3 force_N = Vec3::Zero();         ///< contact plus effects, before the guard
  Vec3 contactForce_N = Vec3::Zero();  ///< contact alone
  Vec3 normalForce_N = Vec3::Zero();   ///< the part along the normals, for force_report = "normal"
  bool touching = false;
  std::int32_t touchedObject = -1;  ///< the one with the largest force; -1: none, or a plane
  double depth_m = 0;
  Vec3 normal = Vec3::Zero();  ///< unit, of all faces together: of the normal force; zero without contact
  Vec3 scp_m = Vec3::Zero();   ///< the proxy less the tool radius along `normal`
  std::uint32_t contactCount = 0;
  std::array<Contact, kMaxContacts> contacts;  ///< one per touched object; their forces sum to contactForce_N
  std::uint32_t status = 0;                    ///< RenderStatus bits
};

/// The contact that is reported as the one that is touched: null without contact. `normal` and `scp_m` are
/// those of all faces together, in a corner of none of them.
const Contact* touchedContact(const Rendering& rendering) noexcept;

enum RenderStatus : std::uint32_t {
  kRenderIterationLimit =
      1U << 0,  ///< the proxy spent its casts before it came to rest; it continues in the next tick
  kRenderCandidateLimit = 1U << 1,  ///< more objects or triangles near the proxy than fit
  kRenderNotFinite = 1U << 2,       ///< an input or the sum was not finite; the force of this tick is zero
  kRenderGeometryJump =
      1U << 3,                ///< geometry or surface in contact changed at once; the guard blends the force
  kRenderReleased = 1U << 4,  ///< a first contact was too deep; no contact force until the HIP leaves
  kRenderPopthrough = 1U << 5,
  kRenderEnclosed =
      1U << 6,  ///< an object appeared around the HIP; it cannot be felt until the HIP has left it
  kRenderWorkLimit = 1U << 7,  ///< too many triangles meet here: the proxy moved as far as they were examined
};

/// Options of the operator, fixed while the loop runs.
struct RenderOptions {
  double toolRadius_m = 0;
  bool forceShading = false;
  double stribeckSpeed_m_per_s = 0;    ///< 0: friction falls to the dynamic one as soon as the proxy slides
  bool contactVibrationPulls = false;  ///< a contact vibration may exceed the normal force and pull
  /// By how much the force of a contact may grow; the guard's limit, before which nothing is late. Infinity:
  /// without it.
  double contactRise_N_per_s = std::numeric_limits<double>::infinity();
  /// Of the arm without a hand, for the passivity controller; infinity: without it.
  double bareDamping_Ns_per_m = std::numeric_limits<double>::infinity();
};

/// Number of the laws from contact to force. It changes when the same ticks give other forces on purpose, so
/// that a re-rendering can name the reason (docs/decisions/0009-stiffness-and-friction.md).
inline constexpr std::uint32_t kForceLaw = 41;

/// Keeps the proxy from tick to tick. Construct it outside the loop; step() is realtime: noexcept, no
/// allocation, no lock. One per servo; not thread-safe.
class Renderer {
 public:
  explicit Renderer(const RenderOptions& options = {});
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// One tick at time `now`, `period` after the previous one. `scene` must live until the end of the next
  /// step().
  void step(const scene::SceneSnapshot& scene, const device::DeviceState& device, Nanos now, Nanos period,
            Rendering& out) noexcept;
  /// Of the last step().
  const PressedFaces& pressed() const noexcept;
  /// Of the last step(): the share of the springs that acts, so that they give no more than the hand put in.
  double energyShare() const noexcept;

  /// For a hand that may be anywhere: the next step() starts without contact at the HIP. Effects go on.
  void restart() noexcept;
  /// The same, and effects and fields begin anew.
  void reset() noexcept;
  /// What resume() needs after a step that had this result; false where more than that is needed: in contact,
  /// and while a force ramps out.
  bool remember(const Rendering& last, RenderMemory& out) const noexcept;
  /// Drops what only saves work, and is not remembered: call it where a memory is taken, as resume() does.
  void forget() noexcept;
  /// Continues after a step that had this result, free of contact, in the scene of the last step().
  void resume(const Rendering& last) noexcept;
  void resume(const RenderMemory& memory) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace hapticd::realtime
