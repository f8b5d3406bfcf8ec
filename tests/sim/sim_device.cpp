#include "sim/sim_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>

#include "device/drivers/drivers.h"
#include "device/simulated/waypoint_path.h"

namespace hapticd::sim {
namespace {

Bench* bench = nullptr;

// Presses, taps, strokes and trembles above and below the top of a cube at 20 mm.
std::shared_ptr<const device::HandPath> drawPath(Dice& dice) {
  std::vector<device::Waypoint> points;
  const auto at = [&](double t_s, double x, double y, double z) {
    points.push_back(
        {t_s, Vec3(x, y, z), geometry::Quat::Identity(), static_cast<std::uint32_t>(dice.below(4))});
  };
  double t = 0;
  at(t, 0, 0.035, 0);
  while (t < 20) {
    const double x = dice.uniform(-0.008, 0.008);
    const double z = dice.uniform(-0.008, 0.008);
    switch (dice.below(4)) {
      case 0:  // presses
        at(t += dice.uniform(0.1, 0.5), x, dice.uniform(0.013, 0.018), z);
        at(t += dice.uniform(0.5, 3.0), x, dice.uniform(0.013, 0.018), z);
        break;
      case 1:  // taps
        for (int i = 0; i < 5; ++i) {
          at(t += dice.uniform(0.06, 0.2), x, 0.026, z);
          at(t += dice.uniform(0.06, 0.2), x, 0.015, z);
        }
        break;
      case 2:  // trembles
        for (int i = 0; i < 30; ++i)
          at(t += 0.05, x + dice.uniform(-5e-4, 5e-4), 0.019 + dice.uniform(-1e-3, 1e-3), z);
        break;
      default:
        at(t += dice.uniform(0.2, 1.0), x, 0.035, z);
    }
  }
  at(t + 0.5, 0, 0.035, 0);
  return std::make_shared<const device::WaypointPath>(std::move(points), device::WaypointPath::Repeat::yes,
                                                      2.0);
}

class SimDevice final : public device::Device {
 public:
  SimDevice() : hand_(handOptions()) { hand_.setPath(drawPath(bench->dice)); }

  void open() override {
    pause(10 * kMs);
    if (openFailures_ > 0) {
      --openFailures_;
      throw std::runtime_error("the simulated cable is unplugged");
    }
    if (!opened_) hand_.open();
    opened_ = true;
    lost_ = bench->lost = false;
    wrote_ = false;
  }
  void close() noexcept override {
    stop();
    pause(5 * kMs);
  }
  const device::DeviceProfile& profile() const noexcept override { return hand_.profile(); }
  device::DeviceTraits traits() const noexcept override {
    return {.selfPaced = bench->ownLoop, .ticksInVendorThread = bench->ownLoop, .needsRearm = true};
  }
  // A vendor's loop calls when it has time, and makes up for nothing.
  void start(std::function<void(Nanos)> onTick) override {
    leaves_ = false;
    loop_ = base::PacedThread({"servo"}, bench->clock,
                              [this, onTick = std::move(onTick)]() -> std::optional<Nanos> {
                                if (leaves_) return std::nullopt;
                                const Nanos now = bench->clock.now();
                                onTick(now);
                                return std::max(now + kMs, bench->clock.now());
                              });
  }
  void stop() noexcept override {
    leaves_ = true;
    loop_.join();
    if (bench->ownLoop && opened_) hand_.write(Vec3::Zero());
  }

  bool read(Nanos now, device::DeviceState& state) noexcept override {
    const Nanos started = bench->clock.now();
    bench->scheduler.handOver();
    begin();
    if (hang_ > 0) hangFor(std::exchange(hang_, 0));
    const device::DeviceState before = state;
    hand_.read(now, state);
    const bool delivered = !lost_ && noState_ == 0;
    if (!delivered) {
      state = before;
    } else {
      distort(state);
      if (buttons_ != state.buttons) {
        buttons_ = state.buttons;
        bench->buttonsChanged(buttons_);
      }
    }
    count(noState_);
    // The time of the tick is its start, also when others ran before it.
    bench->judge.onRead(now, started, delivered, state);
    return delivered;
  }

  bool write(const Vec3& force_N) noexcept override {
    bench->scheduler.handOver();
    wrote_ = true;
    const bool accepted = !lost_ && refuse_ == 0 && hand_.write(force_N);
    if (!accepted) hand_.write(Vec3::Zero());
    count(refuse_);
    bench->judge.onWrite(bench->clock.now(), force_N, accepted);
    bench->wrote(force_N);
    return accepted;
  }
  bool zeroFromOtherThread() noexcept override {
    ++overtaken_;
    return hand_.zeroFromOtherThread();
  }
  std::string faultText() const override {
    return lost_ ? "the simulated cable is unplugged" : fault_ > 0 ? "a simulated fault" : "";
  }
  bool lost() const noexcept override { return lost_; }

 private:
  static device::SimulatedOptions handOptions() {
    device::SimulatedOptions options;
    options.profile.startsArmed = true;
    return options;
  }
  static void count(int& left) noexcept { left -= left > 0 ? 1 : 0; }
  static int ticks(int most) {
    return 1 + static_cast<int>(bench->dice.below(static_cast<std::uint64_t>(most)));
  }
  static void pause(Nanos most) noexcept {
    bench->scheduler.runUntil(bench->clock.now() + bench->dice.between(0, most));
  }
  static bool drawn(double probability) {
    if (bench->quiet || !bench->dice.chance(probability)) return false;
    ++bench->injected;
    return true;
  }

  void begin() {
    const DeviceFaults& f = bench->faults;
    if (drawn(f.noState)) noState_ = ticks(60);
    if (drawn(f.notFinite)) notFinite_ = ticks(20);
    if (drawn(f.hold)) hold_ = ticks(400);
    if (drawn(f.fault)) fault_ = ticks(100);
    if (drawn(f.leap)) {
      leap_ = ticks(6);
      if (bench->dice.chance(0.5)) shaking_ = ticks(1500);
    }
    if (drawn(f.refuse)) refuse_ = ticks(30);
    if (drawn(f.hang)) hang_ = bench->dice.between(2 * kMs, 300 * kMs);
    if (drawn(f.lost)) {
      lost_ = bench->lost = true;
      openFailures_ = static_cast<int>(bench->dice.below(3));
    }
  }

  // The watchdog looks every 5 ms for 20 ms of silence, if the process runs. A loop that has not yet written
  // left no force.
  void hangFor(Nanos length) noexcept {
    constexpr Nanos kSurely = 60 * kMs;
    const std::uint64_t before = overtaken_;
    const Nanos stalled = bench->scheduler.netStalled();
    bench->scheduler.runUntil(bench->clock.now() + length);
    if (wrote_ && length > kSurely && overtaken_ == before && bench->scheduler.netStalled() == stalled)
      bench->finding("the watchdog has not ended the force of a servo that hung for " +
                     std::to_string(length / kMs) + " ms");
  }

  void distort(device::DeviceState& state) noexcept {
    if (notFinite_ > 0) state.position_m.y() = std::numeric_limits<double>::quiet_NaN();
    if (hold_ > 0) state.hold |= device::kHoldDeadMan;
    if (fault_ > 0) state.hold |= device::kHoldFault;
    if (leap_ > 0) {
      state.position_m.x() += 0.02;
      state.velocity_m_per_s.x() = 3;
    } else if (shaking_ > 0) {
      state.velocity_m_per_s.x() = 0.6;  // not too fast any more, and not calm
    }
    count(notFinite_);
    count(hold_);
    count(fault_);
    count(leap_);
    count(shaking_);
  }

  device::SimulatedDevice hand_;
  base::PacedThread loop_;
  bool leaves_ = false;
  bool opened_ = false;
  bool lost_ = false;
  bool wrote_ = false;  // since it was opened
  int openFailures_ = 0;
  int noState_ = 0;
  int notFinite_ = 0;
  int hold_ = 0;
  int fault_ = 0;
  int leap_ = 0;
  int shaking_ = 0;
  int refuse_ = 0;
  Nanos hang_ = 0;
  std::uint64_t overtaken_ = 0;
  std::uint32_t buttons_ = 0;
};

std::unique_ptr<device::Device> makeDevice(const device::DriverOptions&) {
  return std::make_unique<SimDevice>();
}

constexpr device::Driver kDriver{
    .name = "simulated",  // in recordings, which 'hapticd replay' then knows
    .help = "the device of the simulator",
    .keys = {},
    .canBeIsolated = false,
    .make = makeDevice,
};

}  // namespace

ScopedBench::ScopedBench(Bench& with) {
  bench = &with;
}

ScopedBench::~ScopedBench() {
  bench = nullptr;
}

}  // namespace hapticd::sim

// The list of drivers of this program: the linker takes these before those of the room device/drivers.
namespace hapticd::device {

std::span<const Driver* const> drivers() noexcept {
  static constexpr const Driver* kDrivers[] = {&sim::kDriver};
  return kDrivers;
}

const Driver* findDriver(std::string_view name) noexcept {
  return name == sim::kDriver.name ? &sim::kDriver : nullptr;
}

std::string driverNames() {
  return sim::kDriver.name;
}

const std::vector<std::string>& driverKeys() {
  static const std::vector<std::string> keys;
  return keys;
}

}  // namespace hapticd::device
