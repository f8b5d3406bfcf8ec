#include "realtime/render/renderer.h"

#include <algorithm>
#include <utility>

#include "base/time.h"
#include "realtime/render/effects.h"
#include "realtime/render/energy_limit.h"
#include "realtime/render/fields.h"
#include "realtime/render/passivity_controller.h"
#include "realtime/render/proxy.h"
#include "realtime/render/rise_limit.h"
#include "realtime/render/surface_law.h"

namespace hapticd::realtime {
namespace {

constexpr std::uint32_t kChanged = kRenderGeometryJump | kRenderReleased | kRenderWorkLimit | kRenderEnclosed;
constexpr double kShortestPeriod_s = 1e-5;  // keeps speeds finite when a time stamp repeats

void scaleContact(double share, Rendering& out) {
  if (share == 1) return;
  out.contactForce_N *= share;
  out.normalForce_N *= share;
  for (std::uint32_t i = 0; i < out.contactCount; ++i) out.contacts[i].force_N *= share;
}

// The springs alone, as force shading turns them.
Vec3 shadedSprings(const ContactSet& contactSet) {
  Vec3 shaded = Vec3::Zero();
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    shaded += constraint.depth_m * constraint.forceDirection;
  }
  const double stiffness = contactSet.spring.stiffness_N_per_m;
  const double length = shaded.norm();
  return length > 0 ? Vec3(stiffness * contactSet.normal_m.norm() / length * shaded)
                    : Vec3(stiffness * contactSet.normal_m);
}

// The springs of surfaces at rest. Unknown where something moves, or where the surface changes or yields.
SpringState restingSprings(const ContactSet& contactSet, const Springs& springs, bool changed,
                           const Rendering& out) {
  SpringState state;
  const BlendedSpring& spring = contactSet.spring;
  state.known = !changed && !springs.yields && (out.status & (kChanged | kRenderPopthrough)) == 0;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    state.known = state.known && (constraint.rests || constraint.creeps);
  }
  if (!out.touching) return state;
  const double kappa = spring.kappa_N_per_m;
  state.force_N =
      out.contactForce_N - out.normalForce_N + (springs.yields ? springs.sum_N : shadedSprings(contactSet));
  state.normal = out.normal;
  state.pressed_N = out.contactForce_N.dot(out.normal);
  state.stored_J = springs.yields ? springs.stored_J
                                  : 0.5 * kappa * (contactSet.normal_m + contactSet.lateral_m).squaredNorm();
  state.stiffness_N_per_m = kappa;
  state.whole = (out.status & kRenderIterationLimit) == 0;
  return state;
}

// All that takes part in the springs. Force shading keeps the size of the force, and gives energy.
bool restsUnshaded(const ContactSet& contactSet) {
  const auto* const first = contactSet.constraints.data();
  return contactSet.spring.rests &&
         std::all_of(first, first + contactSet.count, [](const ContactConstraint& c) {
           return c.rests && c.forceDirection == c.halfSpace.normal;
         });
}

// `share` of the springs acts.
PressedFaces pressedFaces(const ContactSet& contactSet, bool rest, double share, const Rendering& out) {
  PressedFaces pressed;
  pressed.rest = rest;
  const double stiffness = share * contactSet.spring.stiffness_N_per_m;
  const double springs_N = stiffness * contactSet.normal_m.norm();
  if (!out.touching || !(springs_N > 0)) return pressed;
  for (int i = 0; i < contactSet.count; ++i) {
    const ContactConstraint& constraint = contactSet.constraints[static_cast<std::size_t>(i)];
    if (constraint.depth_m > 0) pressed.add(constraint.forceDirection, constraint.depth_m);
  }
  pressed.stiffness_N_per_m = stiffness;
  pressed.exerted = out.normalForce_N.norm() / springs_N;
  return pressed;
}

}  // namespace

// The contact force of the tick before.
struct LastForce {
  Vec3 force_N = Vec3::Zero();
  double stiffness_N_per_m = 0;
  Vec3 hip = Vec3::Zero();

  // True where the next one differs by more than the way of the hand explains.
  bool stepsTo(const LastForce& next) const noexcept {
    constexpr double kStep_N = 0.1;
    const double byHand_N = std::max(next.stiffness_N_per_m, stiffness_N_per_m) * (next.hip - hip).norm();
    return (next.force_N - force_N).norm() > kStep_N + byHand_N;
  }
};

struct Renderer::State {
  explicit State(const RenderOptions& o)
      : options(o),
        proxy(o),
        effects(o.contactVibrationPulls),
        rise(o.contactRise_N_per_s),
        passivity(o.bareDamping_Ns_per_m) {}

  RenderOptions options;
  Proxy proxy;
  Effects effects;
  Fields fields;
  EnergyLimit energy;
  RiseLimit rise;
  PassivityController passivity;
  LastForce last;
  PressedFaces pressed;
};

Renderer::Renderer(const RenderOptions& options) : state_(std::make_unique<State>(options)) {}
Renderer::~Renderer() = default;

const PressedFaces& Renderer::pressed() const noexcept {
  return state_->pressed;
}

double Renderer::energyShare() const noexcept {
  return state_->energy.share();
}

void Renderer::reset() noexcept {
  restart();
  state_->effects.reset();
  state_->fields.reset();
}

void Renderer::restart() noexcept {
  state_->effects.restart();
  state_->proxy.reset();
  state_->energy.reset();
  state_->rise.reset();
  state_->passivity.reset();
}

bool Renderer::remember(const Rendering& last, RenderMemory& out) const noexcept {
  const bool effects = state_->effects.remember(out);
  const bool fields = state_->fields.remember(out);
  const bool planes = state_->proxy.planes().remember(out);
  return effects && fields && planes && state_->passivity.isEven() && !last.touching && last.status == 0;
}

void Renderer::forget() noexcept {
  state_->proxy.forget();
}

void Renderer::resume(const Rendering& last) noexcept {
  state_->proxy.resume(last.proxy_m);
  state_->last = {last.contactForce_N, 0, last.proxy_m};  // free: the proxy is at the HIP
  state_->energy.reset();
  state_->rise.reset();
  state_->passivity.resume(last.proxy_m);
}

void Renderer::resume(const RenderMemory& memory) noexcept {
  forget();
  state_->effects.resume(memory);
  state_->fields.resume(memory);
  state_->proxy.planes().resume(memory);
}

void Renderer::step(const scene::SceneSnapshot& scene, const device::DeviceState& device, Nanos now,
                    Nanos period, Rendering& out) noexcept {
  State& s = *state_;
  const Vec3& hip = device.position_m;
  out = Rendering{};
  if (!hip.allFinite() || !device.velocity_m_per_s.allFinite() || !device.orientation.coeffs().allFinite()) {
    out.status = kRenderNotFinite;
    s.pressed = {};
    restart();
    return;
  }
  const double radius = s.options.toolRadius_m;
  const double period_s = std::max(base::toSeconds(period), kShortestPeriod_s);
  const ContactSet& contactSet =
      s.proxy.follow({&scene, now}, hip, device.velocity_m_per_s, period_s, out.status);
  out.proxy_m = out.scp_m = s.proxy.position();
  const Springs forces = springsOf(contactSet, radius);
  if ((out.status & kRenderReleased) == 0)
    applySurfaceLaw(contactSet, forces, out.proxy_m, device.velocity_m_per_s, radius, out);
  // A command that changes nothing that is felt, as of a surface elsewhere, is none here.
  const auto felt = [&] { return LastForce{out.contactForce_N, contactSet.spring.kappa_N_per_m, hip}; };
  const auto steps = [&] { return s.proxy.commandChanged() && s.last.stepsTo(felt()); };
  SpringState springs = restingSprings(contactSet, forces, steps(), out);
  const bool limited = (out.status & kChanged) == 0 && !s.proxy.commandChanged() && restsUnshaded(contactSet);
  const double stored = s.energy.step(springs, limited, hip, period_s);
  const double share =
      s.proxy.feltShare() * stored * s.rise.step(stored * out.contactForce_N, springs.known, period_s);
  scaleContact(share, out);
  s.pressed = pressedFaces(contactSet, springs.known, share, out);
  springs.scale(share);
  springs.most_N = s.rise.most_N();
  const Vec3 brake = s.passivity.step(springs, hip, period_s);
  s.rise.acts(out.contactForce_N + brake);
  if ((out.status & kRenderReleased) == 0) {
    applyAdhesion(s.proxy.planes().adhesion(hip, radius), out);
  }
  if (steps()) out.status |= kRenderGeometryJump;
  s.last = felt();
  out.force_N = out.contactForce_N + brake;
  out.force_N += s.effects.force(scene, device, out, (out.normalForce_N + brake).dot(out.normal), now);
  out.force_N += s.fields.force(scene, hip, now);
  if (!out.force_N.allFinite()) {
    out = Rendering{};
    out.proxy_m = out.scp_m = hip;
    out.status = kRenderNotFinite;
    reset();
  }
}

}  // namespace hapticd::realtime
