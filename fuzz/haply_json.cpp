// Messages of the Inverse Service: each is read, or refused with a reason.
#include <string>

#include "device/haply/haply_messages.h"
#include "fuzz/targets.h"

namespace hapticd::fuzz {

void haply_json(Input input) {
  try {
    const std::string wanted = selector(input) % 2 == 0 ? "" : "04BA";
    const auto message = device::haply::parseMessage(textOf(input), wanted);
    if (!message) return;
    require(wanted.empty() || message->deviceId == wanted, "only the wanted device");
    // What follows from a valid message is a valid message.
    static_cast<void>(device::haply::forceMessage(message->deviceId, {1, 2, 3}));
  } catch (const device::haply::MessageError& error) {
    require(*error.what() != '\0', "a refusal has a reason");
  }
}

}  // namespace hapticd::fuzz
