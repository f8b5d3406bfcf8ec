// A joystick as the kernel would show it, at the level of its file.
#pragma once

#include <linux/input.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "device/evdev/event_device.h"

namespace hapticd::device {

/// What the fake shares with the test, which outlives the file. Any thread.
struct FakeJoystick {
  std::mutex mutex;
  bool wheel = false;
  bool hasForce = true;
  int minimum = -32768;
  int maximum = 32767;
  int error = 0;  // errno of all calls from now on
  std::vector<input_event> events;
  std::set<int> pressed;    // keys
  std::map<int, int> axes;  // counts; in the middle until moved
  std::map<int, ff_effect> effects;
  std::set<int> playing;
  std::map<int, int> settings;  // FF_GAIN, FF_AUTOCENTER
  int uploads = 0;

  /// No effect is stored, and none plays.
  bool isIdle() {
    const std::lock_guard lock(mutex);
    return effects.empty() && playing.empty();
  }
  void send(int type, int code, int value) {
    const std::lock_guard lock(mutex);
    input_event event{};
    event.type = static_cast<__u16>(type);
    event.code = static_cast<__u16>(code);
    event.value = value;
    events.push_back(event);
    if (type == EV_ABS) axes[code] = value;
    if (type == EV_KEY && value != 0) pressed.insert(code);
    if (type == EV_KEY && value == 0) pressed.erase(code);
  }
  /// The reader was too slow: what it has not read is gone but for the end of the newest packet.
  void overflow() {
    input_event last{};
    {
      const std::lock_guard lock(mutex);
      if (!events.empty()) last = events.back();
      events.clear();
    }
    send(EV_SYN, SYN_DROPPED, 0);
    if (last.type != EV_SYN) send(last.type, last.code, last.value);
    send(EV_SYN, SYN_REPORT, 0);
  }
  void move(double x, double y) {  // -1 … 1
    send(EV_ABS, ABS_X, count(x));
    send(EV_ABS, ABS_Y, count(y));
  }
  /// In units of the full level: x to the right, z to the user, of all constant forces that play.
  std::pair<double, double> force() {
    const std::lock_guard lock(mutex);
    double x = 0;
    double z = 0;
    for (const auto& [id, effect] : effects) {
      if (effect.type != FF_CONSTANT || playing.count(id) == 0) continue;
      const double angle = 2 * M_PI * effect.direction / 65536;  // from "down" over "left"
      const double level = effect.u.constant.level / 32767.0;
      x += -std::sin(angle) * level;
      z += std::cos(angle) * level;
    }
    return {x, z};
  }
  bool damping() {
    const std::lock_guard lock(mutex);
    return std::any_of(effects.begin(), effects.end(), [&](const auto& entry) {
      return entry.second.type == FF_DAMPER && playing.count(entry.first) != 0;
    });
  }

 private:
  int count(double at) const {
    const double middle = 0.5 * (minimum + maximum);
    return static_cast<int>(std::lround(middle + at * 0.5 * (maximum - minimum)));
  }
};

class FakeEventDevice final : public EventDevice {
 public:
  explicit FakeEventDevice(FakeJoystick& joystick) : joystick_(joystick) {}

  bool control(unsigned long request, void* argument) noexcept override {
    const std::lock_guard lock(joystick_.mutex);
    if (failing()) return false;
    const auto size = _IOC_SIZE(request);
    const unsigned number = _IOC_NR(request);
    if (request == EVIOCSFF) return upload(*static_cast<ff_effect*>(argument));
    if (request == EVIOCRMFF)
      return joystick_.effects.erase(static_cast<int>(reinterpret_cast<long>(argument))) > 0;
    if (number == _IOC_NR(EVIOCGNAME(0))) {
      std::strncpy(static_cast<char*>(argument), "Fake Stick", size);
      return true;
    }
    if (number >= _IOC_NR(EVIOCGBIT(0, 0)) && number < _IOC_NR(EVIOCGBIT(EV_MAX, 0))) {
      bits(static_cast<int>(number - _IOC_NR(EVIOCGBIT(0, 0))), static_cast<unsigned char*>(argument));
      return true;
    }
    if (number == _IOC_NR(EVIOCGABS(ABS_X)) || number == _IOC_NR(EVIOCGABS(ABS_Y))) {
      auto& info = *static_cast<input_absinfo*>(argument);
      info.minimum = joystick_.minimum;
      info.maximum = joystick_.maximum;
      const auto moved = joystick_.axes.find(static_cast<int>(number - _IOC_NR(EVIOCGABS(0))));
      info.value =
          moved != joystick_.axes.end() ? moved->second : (joystick_.minimum + joystick_.maximum) / 2;
      return true;
    }
    if (number == _IOC_NR(EVIOCGKEY(0))) {
      std::memset(argument, 0, size);
      for (const int key : joystick_.pressed) setBit(static_cast<unsigned char*>(argument), key);
      return true;
    }
    errno = EINVAL;
    return false;
  }

  long read(void* data, std::size_t size) noexcept override {
    const std::lock_guard lock(joystick_.mutex);
    if (failing()) return -1;
    const std::size_t count = std::min(joystick_.events.size(), size / sizeof(input_event));
    if (count == 0) return 0;
    std::memcpy(data, joystick_.events.data(), count * sizeof(input_event));
    joystick_.events.erase(joystick_.events.begin(), joystick_.events.begin() + static_cast<long>(count));
    return static_cast<long>(count * sizeof(input_event));
  }

  bool write(const void* data, std::size_t /*size*/) noexcept override {
    const std::lock_guard lock(joystick_.mutex);
    if (failing()) return false;
    const auto& event = *static_cast<const input_event*>(data);
    if (event.code == FF_GAIN || event.code == FF_AUTOCENTER) {
      joystick_.settings[event.code] = event.value;
    } else if (event.value != 0) {
      joystick_.playing.insert(event.code);
    } else {
      joystick_.playing.erase(event.code);
    }
    return true;
  }

  void wait(Nanos most) noexcept override { std::this_thread::sleep_for(std::chrono::nanoseconds(most)); }

 private:
  bool failing() const noexcept {
    if (joystick_.error == 0) return false;
    errno = joystick_.error;
    return true;
  }
  bool upload(ff_effect& effect) noexcept {
    if (effect.id == -1) effect.id = static_cast<__s16>(joystick_.effects.size());
    joystick_.effects[effect.id] = effect;
    ++joystick_.uploads;
    return true;
  }
  static void setBit(unsigned char* out, int bit) noexcept {
    out[bit / 8] = static_cast<unsigned char>(out[bit / 8] | (1 << bit % 8));
  }
  void bits(int type, unsigned char* out) const noexcept {
    const auto set = [&](int bit) { setBit(out, bit); };
    if (type == EV_FF && joystick_.hasForce) {
      set(FF_CONSTANT);
      set(FF_DAMPER);
    }
    if (type == EV_ABS) {
      set(ABS_X);
      set(ABS_Y);
    }
    if (type == EV_KEY) {
      set(BTN_TRIGGER);
      set(BTN_THUMB);
      if (joystick_.wheel) set(BTN_GEAR_DOWN);
    }
  }

  FakeJoystick& joystick_;
};

}  // namespace hapticd::device
