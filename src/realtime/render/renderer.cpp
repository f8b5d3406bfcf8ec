#include "realtime/render/renderer.h"

#include <algorithm>

#include "base/time.h"
#include "realtime/render/effects.h"
#include "realtime/render/fields.h"
#include "realtime/render/proxy.h"
#include "realtime/render/surface_law.h"

namespace hapticd::realtime {
namespace {

constexpr double kShortestPeriod_s = 1e-5;  // keeps speeds finite when a time stamp repeats

void scaleContact(double share, Rendering& out) {
  if (share == 1) return;
  out.contactForce_N *= share;
  out.normalForce_N *= share;
  for (std::uint32_t i = 0; i < out.contactCount; ++i) out.contacts[i].force_N *= share;
}

}  // namespace

struct Renderer::State {
  explicit State(const RenderOptions& o) : options(o), proxy(o), effects(o.contactVibrationPulls) {}

  RenderOptions options;
  Proxy proxy;
  Effects effects;
  Fields fields;
};

Renderer::Renderer(const RenderOptions& options) : state_(std::make_unique<State>(options)) {}
Renderer::~Renderer() = default;

void Renderer::reset() noexcept {
  state_->proxy.reset();
  state_->effects.reset();
  state_->fields.reset();
}

void Renderer::step(const scene::SceneSnapshot& scene, const device::DeviceState& device, Nanos now,
                    Nanos period, Rendering& out) noexcept {
  State& s = *state_;
  const Vec3& hip = device.position_m;
  out = Rendering{};
  if (!hip.allFinite() || !device.velocity_m_per_s.allFinite() || !device.orientation.coeffs().allFinite()) {
    out.status = kRenderNotFinite;
    s.proxy.reset();
    return;
  }
  const double radius = s.options.toolRadius_m;
  const ContactSet& contactSet =
      s.proxy.follow({&scene, now}, hip, std::max(base::toSeconds(period), kShortestPeriod_s), out.status);
  out.proxy_m = out.scp_m = s.proxy.position();
  if ((out.status & kRenderReleased) == 0) {
    applySurfaceLaw(contactSet, out.proxy_m, device.velocity_m_per_s, radius, out);
    scaleContact(s.proxy.feltShare(), out);
    applyAdhesion(s.proxy.planes().adhesion(hip, radius), out);
  }
  out.force_N = out.contactForce_N;
  out.force_N += s.effects.force(scene, device, out, now);
  out.force_N += s.fields.force(scene, hip, now);
  if (!out.force_N.allFinite()) {
    out = Rendering{};
    out.proxy_m = out.scp_m = hip;
    out.status = kRenderNotFinite;
    reset();
  }
}

}  // namespace hapticd::realtime
