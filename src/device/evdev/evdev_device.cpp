#include "device/evdev/evdev_device.h"

#include <linux/input.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "base/world.h"

namespace hapticd::device {
namespace {

constexpr Nanos kMillisecond = 1'000'000;
constexpr Nanos kForcePeriod = 2'000'000;  // 500 Hz: more than a USB poll can use
constexpr Nanos kStateLife = 100'000'000;
constexpr double kVelocityFilter_s = 0.005;
constexpr int kFailuresToFault = 5;
constexpr double kHeight_m = 0.02;  // of the workspace; the hand does not move there

// A set of bits as the kernel fills it.
template <int kBits>
class Bits {
 public:
  Bits(EventDevice& file, int type) noexcept { file.control(EVIOCGBIT(type, sizeof words_), words_); }
  Bits() = default;
  static constexpr std::size_t size() noexcept { return sizeof words_; }
  void* data() noexcept { return words_; }
  bool operator[](int bit) const noexcept {
    constexpr int kWord = 8 * sizeof words_[0];
    return ((words_[bit / kWord] >> (bit % kWord)) & 1UL) != 0;
  }

 private:
  unsigned long words_[kBits / (8 * sizeof(unsigned long)) + 1] = {};
};

std::string nameOf(EventDevice& file) {
  char name[256] = {};
  file.control(EVIOCGNAME(sizeof name - 1), name);
  return name;
}

void requireForce(EventDevice& file, const std::string& path) {
  if (!Bits<FF_MAX>(file, EV_FF)[FF_CONSTANT]) throw NoForceFeedback(path + ": has no constant force");
  if (!Bits<ABS_MAX>(file, EV_ABS)[ABS_X]) throw NoForceFeedback(path + ": has no x axis");
}

}  // namespace

EvdevDevice::EvdevDevice(std::unique_ptr<EventDevice> file, const WheelProfile& profile, bool thread)
    : file_(std::move(file)), given_(true), ownThread_(thread), wheel_(profile) {}

std::string EvdevDevice::probe(const std::string& path) {
  const std::unique_ptr<EventDevice> file = openEventDevice(path);
  requireForce(*file, path);
  return nameOf(*file);
}

void EvdevDevice::open() {
  if (effects_) return;
  if (!given_) {
    wheel_ = options_.profile.empty() ? WheelProfile() : WheelProfile::load(options_.profile);
    findFile();
  }
  requireForce(*file_, options_.path.empty() ? "the input device" : options_.path);
  readCapabilities();
  sample_.write({});
  error_ = failures_ = 0;
  eventsAreMissing_ = false;
  const bool told = readPresentState();
  if (!told || !effects_->begin()) {
    const int error = errno;
    close();
    throw std::system_error(
        error, std::generic_category(),
        profile_.model + (told ? " does not take a force effect" : " does not tell its state"));
  }
  if (!ownThread_) return;
  stopping_ = false;
  thread_ = base::BlockingThread({.name = "evdev", .priority = kDriverPriority}, [this] { run(); });
}

void EvdevDevice::findFile() {
  if (!options_.path.empty()) {
    file_ = openEventDevice(options_.path);
    return;
  }
  std::string words;
  for (const std::string& path : eventDevicePaths()) {
    try {
      probe(path);
      file_ = openEventDevice(path);
      return;
    } catch (const std::runtime_error& error) {
      words += std::string("; ") + error.what();
    }
  }
  throw std::runtime_error("no force-feedback joystick or wheel in /dev/input" + words);
}

void EvdevDevice::readCapabilities() {
  const Bits<KEY_MAX> keys(*file_, EV_KEY);
  const bool hasZ = Bits<ABS_MAX>(*file_, EV_ABS)[ABS_Y];
  // The y axis of a wheel is a pedal.
  const bool isWheel = keys[BTN_GEAR_DOWN] || keys[BTN_GEAR_UP];
  axisCount_ = wheel_.axes != 0 ? wheel_.axes : (hasZ && !isWheel ? 2 : 1);
  axes_[0] = readAxis(ABS_X, wheel_.travelX_m);
  if (axisCount_ == 2) axes_[1] = readAxis(ABS_Y, wheel_.travelZ_m);

  int buttons = 0;
  firstButton_ = 0;
  for (int key = BTN_JOYSTICK; key < BTN_JOYSTICK + 0x40; ++key) {
    if (!keys[key]) continue;
    if (firstButton_ == 0) firstButton_ = key;
    buttons = std::min(key - firstButton_ + 1, 32);
  }
  profile_ = DeviceProfile();
  profile_.model = nameOf(*file_);
  const Vec3 half(wheel_.travelX_m / 2, kHeight_m / 2,
                  axisCount_ == 2 ? wheel_.travelZ_m / 2 : kHeight_m / 2);
  profile_.workspace_m = {-half, half};
  profile_.peakForce_N = wheel_.force_N;
  profile_.continuousForce_N = wheel_.continuousForce_N;
  profile_.nominalStiffness_N_per_m = wheel_.stiffness_N_per_m;
  profile_.ownDamping_Ns_per_m = 1;
  profile_.transportDelay_s = 0.004;  // one period of the exchange and a USB poll
  profile_.buttons = buttons;
  profile_.inputDof = profile_.outputDof = axisCount_;
  effects_.emplace(*file_, wheel_, axisCount_ == 2, Bits<FF_MAX>(*file_, EV_FF)[FF_DAMPER]);
}

EvdevDevice::Axis EvdevDevice::readAxis(int code, double travel_m) {
  input_absinfo info{};
  const bool known = file_->control(EVIOCGABS(static_cast<unsigned>(code)), &info);
  if (!known || info.maximum <= info.minimum) {
    throw std::runtime_error(nameOf(*file_) + ": axis " + std::to_string(code) + " has no range");
  }
  Axis axis;
  axis.code = code;
  axis.centre = 0.5 * (info.minimum + info.maximum);
  axis.scale_m = travel_m / (info.maximum - info.minimum);
  axis.place(info.value);
  axis.before_m = axis.value_m;
  return axis;
}

// What events no longer tell: before the opening, and where the kernel dropped some.
bool EvdevDevice::readPresentState() noexcept {
  for (int i = 0; i < axisCount_; ++i) {
    Axis& axis = axes_[static_cast<std::size_t>(i)];
    input_absinfo info{};
    if (!file_->control(EVIOCGABS(static_cast<unsigned>(axis.code)), &info)) return false;
    axis.place(info.value);
  }
  Bits<KEY_MAX> pressed;
  if (!file_->control(EVIOCGKEY(pressed.size()), pressed.data())) return false;
  buttons_ = 0;
  for (int i = 0; i < profile_.buttons; ++i) {
    if (pressed[firstButton_ + i]) buttons_ |= 1U << i;
  }
  return true;
}

void EvdevDevice::close() noexcept {
  stopping_ = true;
  thread_.join();
  if (effects_) effects_->end();
  effects_.reset();
  if (!given_) file_.reset();
}

void EvdevDevice::run() noexcept {
  while (!stopping_) {
    exchange(base::now());
    if (error_ != 0) {
      base::sleepFor(10 * kMillisecond);  // a device that is gone is always readable
    } else {
      file_->wait(kForcePeriod / 2);
    }
  }
}

void EvdevDevice::exchange(Nanos now) noexcept {
  const Command& command = command_.read();
  if (command.number != lastCommand_) {
    lastCommand_ = command.number;
    commandTime_ = now;
  }
  bool good = readEvents();
  if (good && now >= nextForce_) {
    const bool fresh = now - commandTime_ <= kCommandLife;
    good = effects_->set(fresh ? command.x_N : 0, fresh ? command.z_N : 0);
    nextForce_ = now + kForcePeriod;
    if (good) sentZero_.sent(lastCommand_);
  }
  if (good) {
    failures_ = 0;
    error_ = 0;
  } else if (errno == ENODEV || ++failures_ >= kFailuresToFault) {
    error_ = errno == 0 ? EIO : errno;
  }

  if (before_ != 0 && now > before_) {
    for (Axis& axis : axes_) axis.differentiate(base::toSeconds(now - before_));
  }
  before_ = now;
  Sample sample;
  sample.valid = true;
  sample.state.time = now;
  sample.state.position_m = Vec3(axes_[0].value_m, 0, axes_[1].value_m);
  sample.state.velocity_m_per_s = Vec3(axes_[0].velocity_m_per_s, 0, axes_[1].velocity_m_per_s);
  sample.state.buttons = buttons_;
  sample.state.hold = error_ != 0 ? kHoldFault : kHoldNone;
  sample_.write(sample);
}

bool EvdevDevice::readEvents() noexcept {
  input_event events[32];
  for (;;) {
    const long bytes = file_->read(events, sizeof events);
    if (bytes < 0) return false;
    const auto count = static_cast<std::size_t>(bytes) / sizeof events[0];
    for (std::size_t i = 0; i < count; ++i) {
      const input_event& event = events[i];
      if (event.type == EV_SYN && event.code == SYN_DROPPED) eventsAreMissing_ = true;
      if (eventsAreMissing_) {
        // The rest of a packet whose beginning is lost.
        if (event.type != EV_SYN || event.code != SYN_REPORT) continue;
        if (!readPresentState()) return false;
        eventsAreMissing_ = false;
      }
      const int button = event.code - firstButton_;
      if (event.type == EV_ABS && event.code == axes_[0].code) axes_[0].place(event.value);
      if (event.type == EV_ABS && axisCount_ == 2 && event.code == axes_[1].code) axes_[1].place(event.value);
      if (event.type == EV_KEY && firstButton_ != 0 && button >= 0 && button < 32) {
        const std::uint32_t bit = 1U << button;
        buttons_ = event.value != 0 ? buttons_ | bit : buttons_ & ~bit;
      }
    }
    if (count < std::size(events)) return true;
  }
}

void EvdevDevice::Axis::differentiate(double dt_s) noexcept {
  const double now = (value_m - before_m) / dt_s;
  velocity_m_per_s += dt_s / (kVelocityFilter_s + dt_s) * (now - velocity_m_per_s);
  before_m = value_m;
}

bool EvdevDevice::read(Nanos now, DeviceState& state) noexcept {
  const Sample& newest = sample_.read();
  if (!newest.valid) return false;
  state = newest.state;
  if (now - state.time > kStateLife) state.hold |= kHoldFault;  // the exchange hangs in the kernel
  return true;
}

bool EvdevDevice::write(const Vec3& force_N) noexcept {
  if (!force_N.allFinite()) return false;
  const double size = force_N.norm();
  const Vec3 f = size > profile_.peakForce_N ? Vec3(profile_.peakForce_N / size * force_N) : force_N;
  command_.write({f.x(), f.z(), ++commands_});
  sentZero_.wrote(commands_, f.isZero(0));
  return true;
}

std::string EvdevDevice::faultText() const {
  const int error = error_;
  if (error == 0) return {};
  return profile_.model + ": " + std::strerror(error) + "; plug it in again and open the device anew";
}

}  // namespace hapticd::device
