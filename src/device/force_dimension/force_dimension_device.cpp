#include "device/force_dimension/force_dimension_device.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <set>
#include <stdexcept>

#include "base/thread.h"
#include "base/world.h"
#include "device/profiles.h"

namespace hapticd::device {
namespace {

constexpr Nanos kMillisecond = 1'000'000;
constexpr Nanos kStatusPeriod = 10'000'000;
constexpr int kFailuresToFault = 3;
constexpr const char* kStopped = "the calibration was stopped";
constexpr double kWatchdogStep_s = 125e-6;
constexpr double kGripClosed_rad = 0.05;
constexpr double kGripOpen_rad = 0.10;

// Vendor's frame: x to the user, y right, z up. Ours: x right, y up, z to the user.
Vec3 fromVendor(double x, double y, double z) noexcept {
  return {y, z, x};
}

geometry::Mat3 fromVendor(const double (&m)[3][3]) noexcept {
  constexpr int kOurAxis[3] = {1, 2, 0};  // vendor's axis for our axis i
  geometry::Mat3 rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation(row, column) = m[kOurAxis[row]][kOurAxis[column]];
  }
  return rotation;
}

DeviceProfile nearestProfile(const std::string& name) {
  const char* known = "omega.3";
  for (const char* family : {"delta", "sigma", "lambda"}) {
    if (name.find(family) == std::string::npos) continue;
    known = *family == 'd' ? "delta.3" : *family == 's' ? "sigma.7" : "lambda.7";
  }
  DeviceProfile profile = *findProfile(known);
  if (!name.empty()) profile.model = name;
  // The digit is the number of measured axes: omega.6 has a wrist, omega.7 also a gripper.
  const char digit = name.empty() ? '0' : name.back();
  if (digit == '3' || digit == '6' || digit == '7') {
    profile.inputDof = digit - '0';
    const bool omega = name.find("omega") != std::string::npos;
    profile.outputDof = digit != '7' ? 3 : omega ? 4 : 7;  // an omega.7 has no wrist motors
  }
  return profile;
}

}  // namespace

// The arms of this process. The library gives an arm that is open already to whoever opens it once more, and
// its numbers change when an arm is removed.
class ForceDimensionDevice::Arms {
 public:
  /// One at a time opens and closes.
  static std::unique_lock<std::mutex> lock() { return std::unique_lock(arms().mutex_); }
  static bool isHeld(int id) { return arms().held_.count(id) != 0; }
  static void hold(int id) { arms().held_.insert(id); }
  static void release(int id) { arms().held_.erase(id); }

 private:
  static Arms& arms() {
    static Arms all;
    return all;
  }
  std::mutex mutex_;
  std::set<int> held_;
};

// Grants access to the library to either a calibration or the servo. The servo never waits for it.
class ForceDimensionDevice::Turn {
 public:
  explicit Turn(std::atomic<bool>& busy) noexcept
      : busy_(busy), mine_(!busy.exchange(true, std::memory_order_acquire)) {}
  ~Turn() {
    if (mine_) busy_.store(false, std::memory_order_release);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  explicit operator bool() const noexcept { return mine_; }

 private:
  std::atomic<bool>& busy_;
  const bool mine_;
};

void ForceDimensionDevice::fail(const std::string& what) const {
  const char* words = api_->errorGetLastStr();
  throw std::runtime_error(what + ": " + (words != nullptr ? words : "no reason given"));
}

void ForceDimensionDevice::open() {
  if (id_ >= 0) return;
  api_ = std::make_unique<const dhd::Api>(DynamicLibrary(dhd::libraryNames()));
  const int count = api_->getDeviceCount();
  if (count <= (serial_ ? 0 : options_.index)) {
    throw std::runtime_error("Force Dimension device " + std::to_string(options_.index) +
                             " is not there: " + std::to_string(std::max(count, 0)) +
                             " found; check power, cable and the udev rule for vendor 1451");
  }
  {
    const auto lock = Arms::lock();
    id_ = openArm(count);
    Arms::hold(id_);
  }
  try {
    configure();
  } catch (...) {
    close();
    throw;
  }
  state_ = DeviceState();
  failures_ = 0;
  unreadable_ = false;
  nextStatus_ = 0;
  deviceError_ = switchedOff_ = false;
  hold_ = calibrated_ ? kHoldNone : kHoldNotCalibrated;
}

// The one of the configured number; later the same arm again, whatever its number is then.
int ForceDimensionDevice::openArm(int count) {
  const auto openID = api_->canCalibrate() ? api_->openForCalibration : api_->openID;
  const int first = serial_ ? 0 : options_.index;
  const int last = serial_ ? count - 1 : options_.index;
  std::string others;
  for (int index = first; index <= last; ++index) {
    const int id = openID(static_cast<char>(index));
    if (id < 0) {
      if (!serial_) fail("Force Dimension device " + std::to_string(index) + " does not open");
      continue;
    }
    if (Arms::isHeld(id)) {  // not closed: it is another's
      others += (others.empty() ? "" : ", ") + std::to_string(index) + " is open already";
      continue;
    }
    const std::optional<int> serial = serialOf(id);
    if (!serial_ || serial == serial_) {
      serial_ = serial;
      return id;
    }
    others += (others.empty() ? "" : ", ") + std::to_string(index) + " has the serial number " +
              (serial ? std::to_string(*serial) : "?");
    closeArm(id);
  }
  throw std::runtime_error(
      "the Force Dimension device " +
      (serial_ ? "with the serial number " + std::to_string(*serial_) : std::to_string(options_.index)) +
      " is not there" + (others.empty() ? "" : ": device " + others) + "; check power and cable");
}

std::optional<int> ForceDimensionDevice::serialOf(int id) const {
  unsigned short serial = 0;
  if (api_->getSerialNumber == nullptr || api_->getSerialNumber(&serial, static_cast<char>(id)) < 0)
    return {};
  return serial;
}

void ForceDimensionDevice::closeArm(int id) const noexcept {
  (api_->canCalibrate() ? api_->closeForCalibration : api_->close)(static_cast<char>(id));
}

// Set everything explicitly: a device keeps the settings of the last program.
void ForceDimensionDevice::configure() {
  const auto id = static_cast<char>(id_);
  const char* name = api_->getSystemName(id);
  profile_ = nearestProfile(name != nullptr ? name : "");
  description_ = profile_.model;
  if (serial_) description_ += ", serial number " + std::to_string(*serial_);
  profile_.hasGripper =
      api_->getGripperAngleRad != nullptr && api_->hasGripper != nullptr && api_->hasGripper(id);
  profile_.buttons = profile_.hasGripper ? 2 : 1;

  if (api_->enableForce(0, id) < 0) fail("the amplifiers do not switch off");
  amplifiersOn_ = false;
  if (api_->setTimeGuard(options_.timeGuard_us, id) < 0) fail("the time guard is refused");
  if (api_->setGravityCompensation(options_.gravityCompensation ? 1 : 0, id) < 0) {
    fail("gravity compensation is refused");
  }
  if (options_.effectorMass_kg > 0 && api_->setEffectorMass != nullptr &&
      api_->setEffectorMass(options_.effectorMass_kg, id) < 0) {
    fail("an effector mass of " + std::to_string(options_.effectorMass_kg) + " kg is refused");
  }
  if (api_->setMaxForce != nullptr) api_->setMaxForce(profile_.peakForce_N, id);
  int status[dhd::kStatusLength] = {};
  if (api_->getStatus(status, id) < 0) fail("the status cannot be read");
  calibrated_ =
      status[dhd::kStatusNeedsCalibration] == 0 && (!api_->canCalibrate() || api_->isInitialized(id));
}

void ForceDimensionDevice::close() noexcept {
  if (id_ < 0) return;
  const auto id = static_cast<char>(id_);
  api_->setForceAndTorqueAndGripperForce(0, 0, 0, 0, 0, 0, 0, id);
  api_->enableForce(0, id);
  api_->stop(id);
  {
    const auto lock = Arms::lock();
    closeArm(id_);
    Arms::release(id_);
  }
  amplifiersOn_ = false;
  id_ = -1;
}

bool ForceDimensionDevice::read(Nanos now, DeviceState& state) noexcept {
  if (id_ < 0) return false;
  const Turn turn(busy_);
  if (!turn) {  // calibrating
    state = state_;
    state.time = now;
    state.hold = kHoldNotCalibrated;
    hold_ = state.hold;
    return true;
  }
  const bool good = sample(now);
  failures_ = good ? 0 : std::min(failures_ + 1, kFailuresToFault);
  unreadable_.store(failures_ == kFailuresToFault, std::memory_order_relaxed);
  if (now >= nextStatus_) checkStatus(now);
  state_.hold = kHoldNone;
  if (!calibrated_) state_.hold |= kHoldNotCalibrated;
  if (failures_ == kFailuresToFault || deviceError_) state_.hold |= kHoldFault;
  if (switchedOff_) state_.hold |= kHoldDeadMan;
  hold_.store(state_.hold, std::memory_order_relaxed);
  if (!good && failures_ < kFailuresToFault) return false;
  state = state_;
  return true;
}

bool ForceDimensionDevice::sample(Nanos now) noexcept {
  const auto id = static_cast<char>(id_);
  double x = 0;
  double y = 0;
  double z = 0;
  if (api_->getPosition(&x, &y, &z, id) < 0 || !std::isfinite(x + y + z)) return false;
  const Vec3 position_m = fromVendor(x, y, z);
  if (api_->getLinearVelocity(&x, &y, &z, id) < 0 || !std::isfinite(x + y + z)) return false;
  state_.time = now;
  state_.position_m = position_m;
  state_.velocity_m_per_s = fromVendor(x, y, z);
  double frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (api_->getOrientationFrame(frame, id) >= 0) {
    const geometry::Mat3 rotation = fromVendor(frame);
    if (rotation.allFinite() && rotation.determinant() > 0.5)
      state_.orientation = Quat(rotation).normalized();
  }
  sampleButtons();
  if (profile_.hasGripper) sampleGripper();
  return true;
}

void ForceDimensionDevice::sampleButtons() noexcept {
  const auto id = static_cast<char>(id_);
  const int mask = api_->getButtonMask(id);
  state_.buttons = (state_.buttons & 2U) | (mask > 0 ? static_cast<std::uint32_t>(mask) & 1U : 0U);
}

// Without an answer the value stays unchanged.
void ForceDimensionDevice::sampleGripper() noexcept {
  double angle_rad = 0;
  if (api_->getGripperAngleRad(&angle_rad, static_cast<char>(id_)) < 0 || !std::isfinite(angle_rad)) return;
  angle_rad = std::abs(angle_rad);  // may be negative on a left-handed device
  const bool wasClosed = (state_.buttons & 2U) != 0;
  const bool closed = angle_rad < (wasClosed ? kGripOpen_rad : kGripClosed_rad);
  state_.buttons = (state_.buttons & 1U) | (closed ? 2U : 0U);
  state_.gripper_rad = angle_rad;
}

void ForceDimensionDevice::checkStatus(Nanos now) noexcept {
  nextStatus_ = now + kStatusPeriod;
  const auto id = static_cast<char>(id_);
  int status[dhd::kStatusLength] = {};
  if (api_->getStatus(status, id) < 0) return;
  deviceError_ = status[dhd::kStatusError] != 0;
  switchedOff_ = amplifiersOn_ && status[dhd::kStatusForce] == 0;
  calibrated_ =
      status[dhd::kStatusNeedsCalibration] == 0 && (!api_->canCalibrate() || api_->isInitialized(id));
}

bool ForceDimensionDevice::write(const Vec3& force_N) noexcept {
  if (id_ < 0 || !force_N.allFinite()) return false;
  const Turn turn(busy_);
  if (!turn) return true;  // the calibration drives the motors
  Vec3 f = state_.hold == kHoldNone && failures_ == 0 ? force_N : Vec3(Vec3::Zero());
  if (f.norm() > profile_.peakForce_N) f *= profile_.peakForce_N / f.norm();
  if (!f.isZero() && !amplifiersOn_ && !switchOn()) return false;
  return api_->setForceAndTorqueAndGripperForce(f.z(), f.x(), f.y(), 0, 0, 0, 0, static_cast<char>(id_)) >= 0;
}

bool ForceDimensionDevice::switchOn() noexcept {
  const auto id = static_cast<char>(id_);
  if (api_->setWatchdog != nullptr) {
    const double steps = std::clamp(options_.watchdog_s / kWatchdogStep_s, 0.0, 255.0);
    if (api_->setWatchdog(static_cast<unsigned char>(steps), id) < 0) return false;
  }
  if (api_->enableForce(1, id) < 0) return false;
  amplifiersOn_ = true;
  return true;
}

void ForceDimensionDevice::calibrate(const std::function<bool()>& stopped) {
  if (id_ < 0) throw std::runtime_error("the Force Dimension device is not open");
  for (int i = 0; i < 1000; ++i) {
    if (stopped()) throw std::runtime_error(kStopped);
    const Turn turn(busy_);
    if (!turn) {
      base::sleepFor(kMillisecond);
      continue;
    }
    if (!calibrated_) {
      if (!api_->canCalibrate()) {
        throw std::runtime_error(
            "libdhd alone cannot calibrate: install libdrd, or calibrate with the vendor's tool");
      }
      moveToCalibrate(stopped);
    }
    // The next force switches them on again.
    amplifiersOn_ = false;
    if (api_->enableForce(0, static_cast<char>(id_)) < 0) fail("the amplifiers do not switch off");
    return;
  }
  throw std::runtime_error("the Force Dimension device is busy with another calibration");
}

// The library's call returns when the arm has moved, or when another thread ends its regulation. It may begin
// to regulate after that thread has ended nothing, so the thread repeats that until the call has returned.
void ForceDimensionDevice::moveToCalibrate(const std::function<bool()>& stopped) {
  const auto id = static_cast<char>(id_);
  std::atomic<bool> returned{false};
  std::atomic<bool> ended{false};
  base::BlockingThread person({.name = "calibration"}, [&] {
    while (!returned) {
      if (!ended && stopped()) ended = true;
      if (ended) endRegulation();
      base::sleepFor(kMillisecond);
    }
  });
  const int result = api_->autoInit(id);
  const char* words = result < 0 ? api_->errorGetLastStr() : nullptr;
  const std::string reason = words != nullptr ? words : "no reason given";
  returned = true;
  person.join();
  // Also after a failure, which leaves the arm where it was, with its motors on.
  const bool over = endRegulation();
  calibrated_ = api_->isInitialized(id);
  if (ended) throw std::runtime_error(kStopped);
  if (result < 0) throw std::runtime_error("the calibration failed: " + reason);
  if (!over) fail("the calibration does not end");
}

bool ForceDimensionDevice::endRegulation() noexcept {
  const auto id = static_cast<char>(id_);
  const bool ended = api_->stopRegulation(false, id) >= 0;
  const bool off = api_->enableForce(0, id) >= 0;
  amplifiersOn_ = false;
  return ended && off;
}

std::string ForceDimensionDevice::faultText() const {
  const std::uint32_t hold = hold_;
  if ((hold & kHoldFault) != 0)
    return "the device does not answer or reports an error; check power and cable";
  if ((hold & kHoldNotCalibrated) != 0) {
    return "not calibrated: keep hands off and start hapticd with --calibrate, or re-arm one that was "
           "started so; it moves the arm through its workspace";
  }
  if ((hold & kHoldDeadMan) != 0) {
    return "the device switched its amplifiers off (its button, its speed limit or its watchdog); press the "
           "force button on its base";
  }
  return {};
}

}  // namespace hapticd::device
