// Random scenes with random hands.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "truth/trial.h"

namespace hapticd::truth {

/// The kinds of scenes that randomTrial() makes.
std::span<const char* const> trialKinds();

/// The same seed gives the same trial. `kind`: empty for a random one.
Trial randomTrial(std::uint64_t seed, const std::string& kind = {});

}  // namespace hapticd::truth
