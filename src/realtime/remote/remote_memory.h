// What the laws of streamed contacts and forces know of earlier ones, when none of them acts any more.
#pragma once

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// Without numbers nothing was streamed, and the rest says nothing.
struct RemoteMemory {
  std::uint64_t contacts = 0;  ///< number of the newest set, or 0
  std::uint64_t force = 0;     ///< number of the newest held force, or 0
  double corrections_J = 0;    ///< left for corrections of contacts
  bool started = false;        ///< the held force has its first budget
  EnergyBudget budget;
  double energy_J = 0;  ///< left for the held force; below 0 a debt
  bool spent = false;   ///< the adding part of the held force is being cut, or stays cut
  double cut = 0;       ///< share of it that is
};

}  // namespace hapticd::realtime
