#include "realtime/render/renderer.h"

#include "realtime/render/effects.h"
#include "realtime/render/proxy.h"
#include "realtime/render/surface_law.h"

namespace hapticd::realtime {

struct Renderer::State {
  explicit State(const RenderOptions& o) : options(o), proxy(o.toolRadius_m) {}

  RenderOptions options;
  Proxy proxy;
  Effects effects;
};

Renderer::Renderer(const RenderOptions& options) : state_(std::make_unique<State>(options)) {}
Renderer::~Renderer() = default;

void Renderer::reset() noexcept {
  state_->proxy.reset();
  state_->effects.reset();
}

void Renderer::step(const scene::SceneSnapshot& scene, const device::DeviceState& hand, Nanos now,
                    Nanos period, Rendering& out) noexcept {
  out = Rendering{};
  if (!hand.position_m.allFinite() || !hand.velocity_m_per_s.allFinite() ||
      !hand.orientation.coeffs().allFinite()) {
    out.status = kRenderNotFinite;
    state_->proxy.reset();
    return;
  }
  const Grip& grip =
      state_->proxy.follow({&scene, now}, hand.position_m, geometry::toSeconds(period), out.status);
  out.proxy_m = state_->proxy.position();
  out.scp_m = out.proxy_m;
  if ((out.status & kRenderReleased) == 0) {
    applySurfaceLaw(grip, out.proxy_m, hand.velocity_m_per_s, state_->options.toolRadius_m, out);
  }
  out.force_N = out.contactForce_N +
                state_->effects.force(scene, hand, out, now, state_->options.motorVibrationInDeviceFrame);
  if (!out.force_N.allFinite()) {
    out = Rendering{};
    out.proxy_m = out.scp_m = hand.position_m;
    out.status = kRenderNotFinite;
    reset();
  }
}

}  // namespace hapticd::realtime
