// Whatever a driver's process leaves in the shared memory is a value, or refused.
#include <algorithm>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "device/isolation/shared_block.h"
#include "fuzz/targets.h"

namespace hapticd::fuzz {

void isolation_block(Input input) {
  namespace isolation = device::isolation;
  const auto block = std::make_unique<isolation::SharedBlock>();
  block->state.write({});
  // The process may write to any byte of it, at any time.
  if (!input.empty())
    std::memcpy(static_cast<void*>(block.get()), input.data(), std::min(input.size(), sizeof *block));
  try {
    const device::DeviceProfile profile = block->profile.toProfile();
    require(profile.peakForce_N >= 0 && profile.model.size() <= 128, "a possible profile");
    require(block->profile.toTraits().forceLife >= 0, "a possible life of a force");
  } catch (const std::runtime_error& error) {
    require(*error.what() != '\0', "a refusal has a reason");
  }
  for (int i = 0; i < 3; ++i) {
    const device::DeviceState state = block->state.read().toState();
    require(isolation::Posted::of(state).buttons == state.buttons, "a state survives");
    block->command.write({});
  }
}

}  // namespace hapticd::fuzz
