// One run of the whole server with its clients, drawn from a seed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "sim/scheduler.h"
#include "sim/sim_device.h"

namespace hapticd::sim {

/// What someone does at a time.
struct Action {
  enum class Kind {
    stop,           ///< an operator stops the forces
    rearm,          ///< an operator re-arms
    move,           ///< the owner of the cube streams poses for a while
    batch,          ///< a client moves two objects together
    upload,         ///< a client uploads a large mesh
    appear,         ///< a client comes and starts an effect
    vanish,         ///< and goes, in one of four ways
    pauseRead,      ///< a client stops reading for a while
    nonsense,       ///< a stranger sends what breaks the protocol
    flood,          ///< a client sends thousands of pings
    wallStep,       ///< the wall clock is set
    diskFails,      ///< the disk is full, refuses writes or syncs, or no file can be opened, for a while
    describe,       ///< the scene is compared with what was sent
    stream,         ///< a client comes, streams remote contacts or held forces for a while, and goes
    visit,          ///< somebody asks the web port something
    noMemory,       ///< large allocations of the server's threads fail for a while
    noDescriptors,  ///< the server is out of descriptors for a while, in which clients come
  };
  Nanos at = 0;
  Kind kind = Kind::stop;
  std::uint64_t seed = 0;  ///< of its details
};
const char* nameOf(Action::Kind kind);

/// All of a run but the code of the server: the same script gives the same run.
struct Script {
  std::uint64_t seed = 1;
  Nanos length = 20'000'000'000;
  bool cube = true;  ///< a cube under the hand; else only forces of clients
  bool record = false;
  bool web = false;        ///< with a web port, and a page that takes part
  bool datagrams = false;  ///< with a client that uses them
  bool ownLoop = false;    ///< the device calls the servo
  bool local = false;      ///< with a Unix socket, and an operator who uses it
  Nanos networkDelay = 50'000;
  Nanos networkJitter = 0;
  std::size_t window = std::size_t{256} * 1024;
  Adversity adversity;
  DeviceFaults faults;
  std::vector<Action> actions;
};
Script drawScript(std::uint64_t seed, double seconds);
/// As text, a line for each part.
std::string describe(const Script& script);

struct Outcome {
  std::vector<std::string> findings;  ///< the first few
  std::uint64_t hash = 0;             ///< of all forces, of the log and of the findings
  Nanos firstFinding = 0;
  std::uint64_t ticks = 0;
  std::uint64_t ticksWithForce = 0;
  std::uint64_t ticksInside = 0;
  std::uint64_t steps = 0;
  std::uint64_t preemptions = 0;
  std::uint64_t faults = 0;
  std::uint64_t latches = 0;
  std::uint64_t stops = 0;
  std::uint64_t tickReports = 0;
  std::uint64_t missedReports = 0;
  std::uint64_t replayedTicks = 0;
  std::uint64_t seeks = 0;  ///< in a replay of the recording
  Nanos slowestStop = 0;
};

/// Runs a script in the calling thread. `verbose` prints the server's log with virtual times. `recording`
/// gets the file of a script that records.
Outcome run(const Script& script, bool verbose = false, std::vector<std::byte>* recording = nullptr);

}  // namespace hapticd::sim
