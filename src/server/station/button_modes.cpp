#include "server/station/button_modes.h"

#include <string>
#include <utility>

namespace hapticd::server {

bool ButtonModes::setMode(const wire::ButtonAdmin& admin, std::string& error) {
  const bool momentary = admin.event == wire::kButtonMomentary;
  const bool on = admin.event == wire::kButtonToggleOn;
  if (!momentary && !on && admin.event != wire::kButtonToggleOff) {
    error = "Button Admin: mode " + std::to_string(admin.event) +
            " refused: use 10 (momentary), 20 (toggle, initially off) or 21 (toggle, initially on)";
    return false;
  }
  const bool all = admin.button == wire::kAllButtons;
  if (!all && (admin.button < 0 || admin.button >= count_)) {
    error = "Button Admin: button " + std::to_string(admin.button) + " refused: the device has " +
            std::to_string(count_) + ", numbered from 0; use -99 for all";
    return false;
  }
  for (std::int32_t i = all ? 0 : admin.button; i < (all ? count_ : admin.button + 1); ++i) {
    const std::uint32_t bit = 1U << i;
    if (all && !momentary && (toggles_ & bit) != 0) continue;
    const std::uint32_t toggles = momentary ? toggles_ & ~bit : toggles_ | bit;
    const std::uint32_t nowOn = on ? on_ | bit : on_ & ~bit;
    changed_ |= (toggles_ ^ toggles) | (on_ ^ nowOn);
    toggles_ = toggles;
    on_ = nowOn;
  }
  return true;
}

std::uint32_t ButtonModes::apply(std::uint32_t pressed, std::vector<wire::ButtonAlert>& alerts) {
  const std::uint32_t toggled = pressed & ~before_ & toggles_;
  before_ = pressed;
  on_ ^= toggled;
  const std::uint32_t changed = std::exchange(changed_, 0) | toggled;
  for (std::int32_t i = 0; changed != 0 && i < count_; ++i) {
    if ((changed >> i & 1U) == 0) continue;
    alerts.push_back({i, (on_ >> i & 1U) != 0 ? wire::kButtonToggleOn : wire::kButtonToggleOff});
  }
  return (pressed & ~toggles_) | (on_ & toggles_);
}

}  // namespace hapticd::server
