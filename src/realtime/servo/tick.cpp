#include "realtime/servo/tick.h"

#include <algorithm>
#include <utility>

#include "base/clock.h"
#include "realtime/remote/remote_shape.h"
#include "realtime/render/view_motion.h"
#include "realtime/servo/flush_denormals.h"

namespace hapticd::realtime {
namespace {

constexpr double kViewStep_N = 0.1;  // a larger one, of a view that moves, is blended in

// How much of the force of a tick the guard let through.
double passedShareOf(const TickReport& report) noexcept {
  const double rendered_N = report.rendering.force_N.norm();
  return rendered_N > 0 ? std::min(1.0, report.force_N.norm() / rendered_N) : report.guard.gain;
}

// Where the guard acts, a contact keeps to its rate.
RenderOptions renderOptionsOf(const TickOptions& options) {
  RenderOptions render = options.render;
  if (options.guard.enabled) render.contactRise_N_per_s = options.guard.slew_N_per_s;
  return render;
}

}  // namespace

Tick::Tick(device::Device& device, base::Clock& clock, const TickOptions& options)
    : device_(device),
      clock_(clock),
      period_(servoPeriod(options.rate_Hz)),
      forceLife_(options.forceLife),
      renderer_(renderOptionsOf(options)),
      remotePassivity_(renderOptionsOf(options).contactRise_N_per_s, options.render.bareDamping_Ns_per_m),
      control_(options.guard.armed),
      guard_(options.guard, control_, period_),
      reports_(options.reports),
      blackBox_(static_cast<std::size_t>(options.blackBox_s * options.rate_Hz)) {}

void Tick::operator()(const Pacing& pacing) noexcept {
  const FlushDenormals flush;
  begin(pacing);
  const Nanos started = clock_.now();
  const std::uint32_t overtakes = overtakes_.load(std::memory_order_acquire);
  const scene::SceneSnapshot& scene = takeSnapshot();
  expired_ = forceOutlived();

  haveState_ = device_.read(report_.time, report_.device);
  const bool foundAnew = lookForHand();
  const Nanos period = report_.tick == 1 ? period_ : report_.timing.period;
  const double passedShare = passedShareOf(report_);
  if (sight_.ever) {
    renderer_.step(scene, report_.device, report_.time, period, report_.rendering);
    addRemote(period, foundAnew, passedShare);
  }
  if (handIsLost()) feelNothing();
  report_.force_N = guard_.step(guardInput());
  write(started, overtakes);

  report_.timing.compute = clock_.now() - started;
  publish();
  stoppedAtZero_.store(guard_.seen().stopped && report_.force_N.isZero(0) && device_.zeroSent(),
                       std::memory_order_release);
  finishedAt_.store(clock_.now(), std::memory_order_release);
}

// Between the check and the end of the write the watchdog may overtake this tick, or the device may end the
// last force, which this one would bring back at once: then zero follows.
void Tick::write(Nanos started, std::uint32_t overtakes) noexcept {
  const auto interrupted = [&] {
    return overtakes_.load(std::memory_order_acquire) != overtakes || (!expired_ && forceOutlived());
  };
  const Nanos now = clock_.now();
  discarded_ = interrupted() || now - started > kOldestForce;
  if (discarded_) discardForce();
  written_ = device_.write(report_.force_N);
  const bool late = !discarded_ && interrupted();
  wrote_ = now;
  if (!late) return;
  discarded_ = true;
  discardForce();
  written_ = device_.write(report_.force_N);
}

// The device counts from a later moment than the beginning of the write: it has not ended a force of which
// this is false.
bool Tick::forceOutlived() noexcept {
  return forceLife_ > 0 && wrote_ >= 0 && clock_.now() - wrote_ > forceLife_;
}

void Tick::discardForce() noexcept {
  guard_.discardForce();
  report_.force_N.setZero();
}

void Tick::begin(const Pacing& pacing) noexcept {
  report_.timing.period = report_.tick == 0 ? 0 : std::max<Nanos>(pacing.now - report_.time, 0);
  report_.timing.wakeupError = pacing.wakeupError;
  report_.timing.overruns = pacing.overruns;
  report_.timing.skippedPeriods = pacing.skippedPeriods;
  report_.time = pacing.now;
  ++report_.tick;
}

const scene::SceneSnapshot& Tick::takeSnapshot() noexcept {
  const scene::SceneSnapshot* newest = snapshots_.take();
  const scene::SceneSnapshot& scene = newest != nullptr ? *newest : nothing_;
  report_.revision = scene.revision;
  T_world_before_ = report_.tick == 1 ? scene.workspace.T_world_device : report_.T_world_device;
  report_.T_world_device = scene.workspace.T_world_device;
  sceneSettledAt_ = scene.settledAt;
  return scene;
}

// True for a hand that is seen for the first time, or starts anew because it came on a way that nobody saw:
// while it was out of sight, also for a loop that did not run, or by a calibration, which moves the positions
// and not the hand.
bool Tick::lookForHand() noexcept {
  device::DeviceState& hand = report_.device;
  if (!haveState_ || (hand.hold & device::kHoldFault) != 0) {
    if (!handIsLost()) return false;
    // Nobody knows that it moves, or presses.
    hand.velocity_m_per_s.setZero();
    hand.angularVelocity_rad_per_s.setZero();
    hand.buttons = 0;
    return false;
  }
  const bool calibrated = (hand.hold & device::kHoldNotCalibrated) == 0;
  const bool unseen = handIsLost() || calibrated != sight_.calibrated;
  const bool elsewhere = (hand.position_m - sight_.place_m).norm() > kElsewhere_m;
  const bool first = !sight_.ever;
  sight_ = {true, calibrated, report_.time, hand.position_m};
  if (first) return true;
  if (!unseen || !elsewhere) return false;
  renderer_.restart();
  return true;
}

bool Tick::handIsLost() const noexcept {
  return !sight_.ever || report_.time - sight_.time > kOutOfSight;
}

// The renderer goes on where the hand was last seen, and no contact is reported. The tank keeps what it has.
void Tick::feelNothing() noexcept {
  report_.rendering = Rendering{};
  report_.rendering.proxy_m = report_.rendering.scp_m = report_.device.position_m;
  const double energy_J = report_.remote.energy_J;
  report_.remote = RemoteRendering{};
  report_.remote.energy_J = energy_J;
}

// What a client streams belongs to the world: a view that moved takes it along on the device. A view that
// jumps leaves what is felt to the hand until it is stated anew. The net thread stated what is new in the
// view of the last tick.
const RemoteContactSet& Tick::inThisView(const RemoteContactSet& newest, bool fresh) noexcept {
  const Affine T_device_world = report_.T_world_device.inverse();
  const ViewMotion view{T_device_world, T_world_before_};
  const Affine motion = T_device_world * T_world_before_;
  if (!view.jumpsAt(report_.device.position_m)) remoteContacts_.moveWithView(motion);
  if (!fresh) return newest;
  carried_ = newest;
  for (std::uint32_t i = 0; i < carried_.count; ++i) moveBy(motion, carried_.contacts[i]);
  return carried_;
}

// Nothing streamed so far, and nothing left of it, costs two comparisons.
void Tick::addRemote(Nanos period, bool foundAnew, double passedShare) noexcept {
  const RemoteInput& input = remoteInput_.read();
  if (input.contacts.number != contactsSeen_ || input.force.number != forceSeen_) {
    if (StreamRing* ring = recordStreamTo_.load(std::memory_order_acquire)) ring->push({report_.tick, input});
  }
  const bool fresh = input.contacts.number != contactsSeen_;
  contactsSeen_ = input.contacts.number;
  forceSeen_ = input.force.number;
  if (foundAnew) {
    remoteContacts_.restart(contactsSeen_);
    remotePassivity_.reset();
    heldForce_.restart(report_.device.position_m);
  }
  RemoteRendering& out = report_.remote;
  out.status = 0;
  out.count = 0;
  Rendering& rendering = report_.rendering;
  if (contactsSeen_ == 0 && forceSeen_ == 0) {
    remotePassivity_.idle(rendering.contactForce_N);
    return;
  }
  if ((rendering.status & kRenderNotFinite) != 0) {
    remoteContacts_.reset();
    remotePassivity_.reset();
    heldForce_.reset();
    out.contactForce_N.setZero();
    out.heldForce_N.setZero();
    return;
  }
  const double step_s = base::toSeconds(std::min(period, 2 * period_));  // a late tick changes no more
  const RemoteHand hand{report_.device.position_m, report_.device.velocity_m_per_s, renderer_.pressed()};
  const Vec3 before_N = out.contactForce_N;
  const bool viewMoved = T_world_before_.matrix() != report_.T_world_device.matrix();
  const RemoteContactSet& contacts = viewMoved ? inThisView(input.contacts, fresh) : input.contacts;
  remoteContacts_.step(contacts, hand, report_.time, step_s, out);
  if (viewMoved && (out.contactForce_N - before_N).norm() > kViewStep_N)
    rendering.status |= kRenderGeometryJump;
  remotePassivity_.step(remoteContacts_, rendering.contactForce_N, hand.position_m, base::toSeconds(period),
                        out);
  rendering.force_N += out.contactForce_N;
  heldForce_.step(input.force, hand.position_m, hand.velocity_m_per_s, report_.time, step_s, passedShare,
                  out);
  rendering.force_N += out.heldForce_N;
}

GuardInput Tick::guardInput() const noexcept {
  GuardInput in;
  in.force_N = report_.rendering.force_N;
  in.state = haveState_ ? &report_.device : nullptr;
  in.period = report_.timing.period;
  // A callback has no deadline: there, the excess of the period counts as lateness.
  in.late = std::max(report_.timing.wakeupError, report_.timing.period - period_);
  in.writeFailed = !written_;
  in.forceEnded = expired_;
  in.notFinite = (report_.rendering.status & kRenderNotFinite) != 0;
  in.geometryJump = (report_.rendering.status & kRenderGeometryJump) != 0;
  in.deepContact = (report_.rendering.status & (kRenderReleased | kRenderEnclosed)) != 0;
  return in;
}

void Tick::resume(const TickReport& last) noexcept {
  report_ = last;
  sight_ = {true, (last.device.hold & device::kHoldNotCalibrated) == 0, last.time, last.device.position_m};
  renderer_.resume(last.rendering);
  guard_.resume(last.guard, last.force_N);
}

void Tick::resume(const TickReport& last, const ServoMemory& memory) noexcept {
  resume(last);
  renderer_.resume(memory.render);
  guard_.resume(memory.guard);
  if (memory.remote.contacts == 0 && memory.remote.force == 0) return;
  // As if what was streamed before had been: it has ended, but the tanks go on.
  RemoteInput ended;
  ended.contacts.number = contactsSeen_ = memory.remote.contacts;
  ended.force.number = forceSeen_ = memory.remote.force;
  ended.force.budget = memory.remote.budget;
  remoteInput_.write(ended);
  remoteContacts_.resume(memory.remote, last.device.position_m);
  remotePassivity_.resume(last.device.position_m);
  heldForce_.resume(memory.remote, last.device.position_m);
}

// Once whole, nothing more is remembered until the next recording.
void Tick::remember(MemoryRing* ring) noexcept {
  const bool first = std::exchange(rememberedTo_, ring) != ring;
  if (first) memory_.whole = false;
  if (ring == nullptr || memory_.whole) return;
  memory_.tick = report_.tick;
  const bool rendering = renderer_.remember(report_.rendering, memory_.render);
  const bool guard = guard_.remember(memory_.guard);
  const bool remote = rememberRemote();
  memory_.whole = rendering && guard && remote && sight_.ever && sight_.time == report_.time &&
                  report_.time > sceneSettledAt_ &&
                  report_.revision >= rememberFrom_.load(std::memory_order_acquire);
  if (first || memory_.whole) ring->push(memory_);
  if (memory_.whole) renderer_.forget();
}

// False while something that was streamed acts, or may still fade.
bool Tick::rememberRemote() noexcept {
  RemoteMemory& memory = memory_.remote;
  memory.contacts = contactsSeen_;
  memory.force = forceSeen_;
  const bool contacts = remoteContacts_.remember(memory) && remotePassivity_.isEven();
  const bool force = heldForce_.remember(memory);
  if (contactsSeen_ == 0 && forceSeen_ == 0) return true;
  const RemoteInput& input = remoteInput_.read();
  const Nanos ended =
      std::max(input.contacts.received + kLongestRemoteLife, input.force.received + input.force.lifetime);
  return contacts && force && report_.time > ended + kLongestRemoteLife;
}

void Tick::publish() noexcept {
  const std::uint32_t latchedBefore = report_.guard.latched;
  report_.guard = guard_.report();
  report_.dropped = reports_.dropped();
  if (report_.tick > 1) histograms_.period.add(report_.timing.period);
  histograms_.wakeupError.add(report_.timing.wakeupError);
  histograms_.compute.add(report_.timing.compute);

  blackBox_.record(report_);
  if ((report_.guard.latched & ~latchedBefore) != 0) blackBox_.freeze();
  if (RecordRing* ring = recordTo_.load(std::memory_order_acquire)) {
    remember(rememberTo_.load(std::memory_order_acquire));
    ring->push({report_, guard_.seen(), haveState_, written_, discarded_, expired_});
  } else {
    remember(nullptr);
  }
  reports_.push(report_);
  wake_.notify();
}

}  // namespace hapticd::realtime
