// What each kind of device can do, where its driver does not say.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "device/device.h"

namespace hapticd::device {

/// All known profiles; the first is the simulated device.
std::span<const DeviceProfile> profiles();

/// The profile of a model, or of another name that it is sold under, whatever the case; null when unknown.
const DeviceProfile* findProfile(std::string_view model);

/// What a person should know of it, on one line.
std::string inWords(const DeviceProfile& profile);

}  // namespace hapticd::device
