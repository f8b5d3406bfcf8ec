// Profiles of known models, for values that the driver does not report.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "device/device.h"

namespace hapticd::device {

/// All known profiles; the first is the simulated device.
std::span<const DeviceProfile> profiles();

/// The profile of a model by its name or one of its other trade names, case-insensitive; null when unknown.
const DeviceProfile* findProfile(std::string_view model);

/// Viscous friction of the arm of a model without a hand, N s/m, which the passivity controller credits. A
/// cautious choice, not measured; zero for an unknown model. Infinity for the simulated hand: nobody lets it
/// go.
double bareDampingOf(std::string_view model);

/// Summary for the log, on one line.
std::string inWords(const DeviceProfile& profile);

}  // namespace hapticd::device
