#include "device/driver.h"
#include "device/replay/replay_device.h"

namespace hapticd::device::drivers_in_this_build {
namespace {

std::unique_ptr<Device> make(const DriverOptions& options) {
  if (options.hand == "script")
    throw InvalidDriverOption(R"(replay needs a recorded hand: hand = "FILE.csv", or --hand FILE.csv)");
  ReplayOptions own;
  own.file = options.hand;
  own.repeat = true;
  HandFile::load(own.file);  // a wrong one is a mistake in the configuration
  return std::make_unique<ReplayDevice>(own);
}

}  // namespace

extern const Driver replay;
const Driver replay{.name = "replay",
                    .help = "a recorded hand, again and again",
                    .keys = {},
                    .hasHardware = false,
                    .hasHand = true,
                    .make = make};

}  // namespace hapticd::device::drivers_in_this_build
