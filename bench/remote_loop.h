// A simulated hand presses on a wall that a client renders across a network: how stiff may the wall be? For
// the tests and for the benchmark that prints the table.
#pragma once

#include <cstdint>

#include "realtime/servo/tick.h"

namespace hapticd::bench {

/// Who renders the wall.
enum class WallBy {
  heldForce,      ///< the client sends a force, which is held as it is
  tankedForce,    ///< the same as Held_Force: slew, lifetime and energy budget
  remoteContact,  ///< the client streams the wall
  local,          ///< the wall is in the server's scene
};

struct RemoteLoop {
  WallBy by = WallBy::remoteContact;
  double rate_Hz = 60;     ///< of the client
  double jitter_s = 0;     ///< of its period, both ways
  double delay_s = 0.020;  ///< each way
  double loss = 0;         ///< share of the messages
  double handDamping_Ns_per_m = 1;
  double servo_Hz = 1000;
  std::uint64_t seed = 1;
};

struct WallPress {
  double peakToPeak_m = 0;  ///< in the last second of six, five of them at rest
  double force_N = 0;       ///< at the end
  double largestForce_N = 0;
};

/// From 5 mm above the wall to 8 mm below it in half a second, then at rest.
WallPress pressWall(double stiffness_N_per_m, const RemoteLoop& loop);

/// Whether the hand comes to rest within 10 um.
bool settles(double stiffness_N_per_m, const RemoteLoop& loop);

/// The stiffest wall that settles, to one percent; 0 when not even 10 N/m does.
double stiffestWall(const RemoteLoop& loop);

}  // namespace hapticd::bench
