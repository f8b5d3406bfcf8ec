#include "device/openhaptics/openhaptics_device.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/world.h"
#include "device/profiles.h"

namespace hapticd::device {
namespace {

constexpr Nanos kMillisecond = 1'000'000;
constexpr double kMetresPerMillimetre = 1e-3;
constexpr double kHot = 0.95;
constexpr double kCool = 0.7;
constexpr Nanos kForceErrorHold = 100'000'000;  // the amplifiers switch off and ramp up by themselves
constexpr Nanos kWarmHold = 1'000'000'000;
constexpr int kSettlingFrames = 100;
constexpr std::uint64_t kCalibrationCheck = 100;  // frames, while calibrated
constexpr double kSilence_s = 0.5;                // no hand holds an arm bit-identical for this long
constexpr double kImpulseShare = 0.9;             // margin below the vendor driver's own limit

bool contains(const std::string& text, const char* word) {
  return text.find(word) != std::string::npos;
}

DeviceProfile nearestProfile(const std::string& model) {
  const char* known = "Touch";
  if (contains(model, "Premium")) known = "Premium 1.5";
  if (contains(model, "Touch X") || contains(model, "Desktop")) known = "Touch X";
  DeviceProfile profile = *findProfile(known);
  if (!model.empty()) profile.model = model;
  return profile;
}

std::string text(const char* words) {
  return words == nullptr ? std::string() : std::string(words);
}

}  // namespace

void OpenHapticsDevice::open() {
  if (handle_ != hd::kInvalidHandle) return;
  scheduler_ = hd::Scheduler::get();
  std::string name;
  handle_ = scheduler_->open(options_.name, name);
  scheduler_->whileStopped(handle_, [&] { readIdentity(); });
  description_ += ", opened as " + name;
  derating_ = ThermalDerating(profile_.peakForce_N, profile_.continuousForce_N);
  state_ = DeviceState();
  written_N_.setZero();
  frames_ = 0;
  calibrated_ = hot_ = refuses_ = false;
  lost_ = silent_ = unreported_ = false;
  sameFrames_ = 0;
  settling_ = 0;
  hotUntil_ = faultUntil_ = 0;
  hold_ = kHoldNotCalibrated;
  lastError_ = hd::kSuccess;
  consent_ = options_.calibrate;
}

// Plausible values of the vendor's driver win over the table.
void OpenHapticsDevice::readIdentity() {
  const hd::Api& api = scheduler_->api();
  const std::string model = text(api.getString(hd::kModel));
  description_ = model + ", serial number " + text(api.getString(hd::kSerialNumber)) + ", driver " +
                 text(api.getString(hd::kDriverVersion));
  profile_ = nearestProfile(model);
  hasSafetySwitch_ = contains(model, "Desktop");  // other models have none, and it reads as open
  calibrationStyle_ = 0;
  api.getIntegerv(hd::kCalibrationStyle, &calibrationStyle_);

  const auto replace = [&](double& value, hd::Enum what, double scale, double least, double most) {
    double said[6] = {};
    api.getDoublev(what, said);
    if (said[0] * scale >= least && said[0] * scale <= most) value = said[0] * scale;
  };
  replace(profile_.peakForce_N, hd::kMaxForce, 1, 0.5, 50);
  replace(profile_.continuousForce_N, hd::kMaxContinuousForce, 1, 0.1, profile_.peakForce_N);
  profile_.continuousForce_N = std::min(profile_.continuousForce_N, profile_.peakForce_N);
  replace(profile_.nominalStiffness_N_per_m, hd::kMaxStiffness, 1000, 50, 10000);
  replace(velocityLimit_m_per_s_, hd::kSoftwareVelocityLimit, kMetresPerMillimetre, 0.1, 10);
  replace(impulseLimit_N_, hd::kSoftwareImpulseLimit, 1, 0.01, 50);

  double box[6] = {};
  api.getDoublev(hd::kUsableWorkspace, box);
  const Vec3 min = kMetresPerMillimetre * Vec3(box[0], box[1], box[2]);
  const Vec3 max = kMetresPerMillimetre * Vec3(box[3], box[4], box[5]);
  if (((max - min).array() > 0.02).all() && ((max - min).array() < 2).all())
    profile_.workspace_m = {min, max};
  readAxes();
  scheduler_->takeErrors();  // an older driver does not know every value
}

void OpenHapticsDevice::readAxes() {
  const auto replace = [&](int& value, hd::Enum what) {
    int said = 0;
    scheduler_->api().getIntegerv(what, &said);
    if (said == 3 || said == 6 || said == 7) value = said;
  };
  replace(profile_.inputDof, hd::kInputDof);
  replace(profile_.outputDof, hd::kOutputDof);
  profile_.switches = hasSafetySwitch_ ? kHoldDeadMan : kHoldNone;
  if ((calibrationStyle_ & hd::kStyleInkwell) != 0) profile_.switches |= kHoldInkwell;
}

void OpenHapticsDevice::close() noexcept {
  if (handle_ == hd::kInvalidHandle) return;
  stop();
  scheduler_->close(handle_);
  handle_ = hd::kInvalidHandle;
}

void OpenHapticsDevice::start(std::function<void(Nanos)> onTick) {
  if (handle_ == hd::kInvalidHandle) throw std::runtime_error("the OpenHaptics device is not open");
  if (started_) return;
  onTick_ = std::move(onTick);
  quiet_ = Quiet::no;
  scheduler_->join(handle_, *this, options_.rate_Hz);
  started_ = true;
}

void OpenHapticsDevice::stop() noexcept {
  if (!started_) return;
  // Send one frame with zero force first; the amplifiers switch off with the scheduler in any case.
  quiet_ = Quiet::wanted;
  for (int i = 0; i < 20 && quiet_ != Quiet::reached; ++i) base::sleepFor(kMillisecond);
  scheduler_->leave(*this);
  started_ = false;
}

bool OpenHapticsDevice::read(Nanos /*now*/, DeviceState& state) noexcept {
  if (!inTick_) return false;
  state = state_;
  return true;
}

bool OpenHapticsDevice::write(const Vec3& force_N) noexcept {
  if (!inTick_ || !force_N.allFinite()) return false;
  // A refusal tells the guard that the motors get zero: when the arm is slow again, it ramps the force in.
  const bool fast = state_.velocity_m_per_s.norm() > velocityLimit_m_per_s_;
  refuses_ = fast && (refuses_ || !force_N.isZero());
  sentZero_.wrote(++commands_, refuses_ || force_N.isZero(0));
  if (refuses_) return false;
  command_N_ = force_N;
  return true;
}

void OpenHapticsDevice::onFrame() noexcept {
  const hd::Api& api = scheduler_->api();
  const bool quiet = quiet_ != Quiet::no;
  now_ = base::now();
  api.makeCurrentDevice(handle_);
  api.beginFrame(handle_);
  hd::Enum calibration = hd::kCalibrationOk;
  if (!calibrated_ || frames_ % kCalibrationCheck == 0) {
    calibration = api.checkCalibration();
    calibrated_ = calibration == hd::kCalibrationOk;
  }
  sample(now_);
  command_N_.setZero();
  if (!quiet && onTick_) {
    inTick_ = true;
    onTick_(now_);
    inTick_ = false;
  }
  written_N_ = quiet ? Vec3(Vec3::Zero()) : limited(command_N_);
  api.setDoublev(hd::kCurrentForce, written_N_.data());
  if (profile_.outputDof > 3) {
    constexpr double kNoTorque[3] = {};
    api.setDoublev(hd::kCurrentGimbalTorque, kNoTorque);
  }
  api.endFrame(handle_);
  sentZero_.sent(commands_);

  if (!calibrated_) updateCalibration(calibration);
  scheduler_->drainErrors();
  ++frames_;
  if (quiet) quiet_ = Quiet::reached;
}

void OpenHapticsDevice::sample(Nanos now) noexcept {
  const hd::Api& api = scheduler_->api();
  Vec3 v = Vec3::Zero();
  state_.time = now;
  api.getDoublev(hd::kCurrentPosition, v.data());
  state_.position_m = kMetresPerMillimetre * v;
  api.getDoublev(hd::kCurrentVelocity, v.data());
  state_.velocity_m_per_s = kMetresPerMillimetre * v;
  api.getDoublev(hd::kCurrentAngularVelocity, state_.angularVelocity_rad_per_s.data());
  geometry::Mat4 T_device_stylus = geometry::Mat4::Identity();
  api.getDoublev(hd::kCurrentTransform, T_device_stylus.data());
  const geometry::Mat3 rotation = T_device_stylus.topLeftCorner<3, 3>();
  if (rotation.allFinite() && rotation.determinant() > 0.5) {
    state_.orientation = Quat(rotation).normalized();
  }
  int buttons = 0;
  api.getIntegerv(hd::kCurrentButtons, &buttons);
  state_.buttons = static_cast<std::uint32_t>(buttons);
  double temperatures[6] = {};
  api.getDoublev(hd::kMotorTemperature, temperatures);
  state_.motorTemperature = *std::max_element(std::begin(temperatures), std::end(temperatures));
  noticeSilence();
  state_.hold = holds(now);
  hold_.store(state_.hold, std::memory_order_relaxed);
}

// The library reports an identical error only once, and a cable may be pulled twice. The second loss shows
// only as an arm that does not move under a force.
void OpenHapticsDevice::noticeSilence() noexcept {
  const bool same = state_.position_m == before_.position_m &&
                    state_.velocity_m_per_s == before_.velocity_m_per_s &&
                    state_.orientation.coeffs() == before_.orientation.coeffs();
  before_ = state_;
  if (!same) sameFrames_ = 0;
  if (!written_N_.isZero()) ++sameFrames_;
  if (sameFrames_ < kSilence_s * options_.rate_Hz || !scheduler_->deviceErrorTold()) return;
  silent_ = true;
  lost_ = true;
}

std::uint32_t OpenHapticsDevice::holds(Nanos now) noexcept {
  const hd::Api& api = scheduler_->api();
  std::uint32_t hold = kHoldNone;
  if (!calibrated_ || settling_ > 0) hold |= kHoldNotCalibrated;
  if (settling_ > 0) --settling_;
  if ((calibrationStyle_ & hd::kStyleInkwell) != 0) {
    hd::Boolean away = 1;  // the switch reads 0 with the stylus docked
    api.getBooleanv(hd::kCurrentInkwellSwitch, &away);
    if (away == 0) hold |= kHoldInkwell;
  }
  if (hasSafetySwitch_) {
    hd::Boolean held = 1;
    api.getBooleanv(hd::kCurrentSafetySwitch, &held);
    if (held == 0) hold |= kHoldDeadMan;
  }
  hot_ = state_.motorTemperature > (hot_ ? kCool : kHot);
  if (hot_ || now < hotUntil_) hold |= kHoldHot;
  const bool finite = state_.position_m.allFinite() && state_.velocity_m_per_s.allFinite();
  if (lost_ || now < faultUntil_ || !finite) hold |= kHoldFault;
  return hold;
}

// The position jumps with an update, so update only after a frame without force. A stylus in the inkwell is
// in the right place, and a person put it there. Where no switch shows the place of the arm, a person must
// consent.
void OpenHapticsDevice::updateCalibration(hd::Enum status) noexcept {
  if (!written_N_.isZero()) return;
  const bool encoders = (calibrationStyle_ & hd::kStyleEncoderReset) != 0;
  const bool ready = status == hd::kCalibrationNeedsUpdate;  // moved enough, or docked
  const bool docked = (state_.hold & kHoldInkwell) != 0;
  int style = 0;
  if ((calibrationStyle_ & hd::kStyleAuto) != 0 && ready) {
    style = hd::kStyleAuto;
  } else if (encoders && consent_) {
    style = hd::kStyleEncoderReset;
  } else if (!encoders && ready && (docked || consent_)) {
    style = hd::kStyleInkwell;
  } else {
    return;
  }
  if (style != hd::kStyleAuto) consent_ = false;
  scheduler_->api().updateCalibration(static_cast<hd::Enum>(style));
  settling_ = kSettlingFrames;
}

Vec3 OpenHapticsDevice::limited(const Vec3& force_N) noexcept {
  const double limit = derating_.step(state_.motorTemperature);
  if (state_.hold != kHoldNone) return Vec3::Zero();
  const double wanted = force_N.norm();
  Vec3 force = wanted > limit ? Vec3(limit / wanted * force_N) : force_N;
  // The force rises in steps and falls at once: less force is always safe.
  const double step = kImpulseShare * impulseLimit_N_;
  const Vec3 change = force - written_N_;
  if (force.norm() > written_N_.norm() && change.norm() > step) {
    force = written_N_ + step / change.norm() * change;
  }
  return force;
}

void OpenHapticsDevice::onError(hd::Enum code) noexcept {
  if (code < hd::kForceErrors) return;  // this device does not have that value
  lastError_ = code;
  if (code == hd::kWarmMotors) {
    hotUntil_ = now_ + kWarmHold;
  } else if (hd::isDeviceError(code)) {
    // The library reports the same error only once, so silence does not mean that the device is back.
    lost_ = true;
  } else {
    faultUntil_ = now_ + kForceErrorHold;
    unreported_ = true;
  }
}

void OpenHapticsDevice::calibrate(const std::function<bool()>& stopped) {
  if (!started_)
    throw std::runtime_error("calibration needs the servo loop of the OpenHaptics device to run");
  consent_ = true;
  for (int i = 0; i < 300; ++i) {
    if ((hold_ & kHoldNotCalibrated) == 0) {
      consent_ = false;
      return;
    }
    if (stopped()) {
      consent_ = false;
      throw std::runtime_error("the calibration was stopped");
    }
    base::sleepFor(10 * kMillisecond);
  }
  consent_ = false;
  throw std::runtime_error("the OpenHaptics device is not calibrated after 3 s: " + faultText());
}

std::string OpenHapticsDevice::faultText() const {
  const std::uint32_t hold = hold_;
  std::string words;
  const auto say = [&](const std::string& sentence) { words += (words.empty() ? "" : "; ") + sentence; };
  // A force error holds for a moment only; later callers still get its text.
  if (unreported_.exchange(false) || (hold & kHoldFault) != 0) {
    const hd::Enum code = lastError_;
    if (silent_) {
      say("the driver gave one and the same position for half a second under a force, and it tells a lost "
          "device only once");
    } else {
      say(code == hd::kSuccess ? "the driver gives positions that are not numbers"
                               : "the driver reports " + std::string(hd::errorName(code)));
    }
    if (silent_ || hd::isDeviceError(code)) say("check the cable and open the device anew");
  }
  if ((hold & kHoldNotCalibrated) != 0) {
    if ((calibrationStyle_ & hd::kStyleEncoderReset) != 0) {
      say("not calibrated: bring the arm into its reset position and start hapticd with --calibrate, or "
          "re-arm one that was started so");
    } else if ((calibrationStyle_ & hd::kStyleInkwell) != 0) {
      say("not calibrated: put the stylus into the inkwell");
    } else {
      say("not calibrated: move the arm slowly through its workspace");
    }
  }
  if ((hold & kHoldInkwell) != 0) say("the stylus is in the inkwell");
  if ((hold & kHoldDeadMan) != 0) say("nobody holds the stylus");
  if ((hold & kHoldHot) != 0) say("the motors are too hot; let them cool");
  return words;
}

}  // namespace hapticd::device
