// What a thread needs from the system to keep 1 kHz, what it got, and what to do about the rest.
#pragma once

#include <array>
#include <string>

namespace hapticd::realtime {

/// What to ask for.
struct ThreadRequest {
  bool realtime = true;  ///< SCHED_FIFO
  /// Somebody else's thread: says what it has, changes neither that nor the stack.
  bool keepScheduling = false;
  int priority = 80;       ///< 1…99
  int cpu = -1;            ///< -1: any
  bool lockMemory = true;  ///< the whole process
};

/// One request and its answer.
struct SetupAnswer {
  const char* name = "";  ///< scheduling, affinity, memory, stack, denormals
  bool asked = false;
  bool granted = false;
  std::string text{};    ///< what is the case now
  std::string remedy{};  ///< how to get it; empty when granted or not asked
};

/// All answers for one thread.
struct ThreadSetup {
  SetupAnswer scheduling{"scheduling"};
  SetupAnswer affinity{"affinity"};
  SetupAnswer memory{"memory"};
  SetupAnswer stack{"stack"};
  SetupAnswer denormals{"denormals"};

  std::array<const SetupAnswer*, 5> all() const noexcept {
    return {&scheduling, &affinity, &memory, &stack, &denormals};
  }
  /// Everything that was asked for was granted.
  bool granted() const noexcept {
    for (const SetupAnswer* answer : all()) {
      if (answer->asked && !answer->granted) return false;
    }
    return true;
  }
  /// One line for each thing that was asked for and not granted, with its remedy.
  std::string complaints() const;
};

/// Asks for short turns of the calling thread, so that the scheduler lets it run soon after it is woken:
/// needs no rights, and takes from others nothing but the order. Threads that it starts have turns as
/// everybody. Without effect before Linux 6.12.
void requestShortTimeSlice() noexcept;

/// Asks for the calling thread. Allocates and enters the system: before the loop. Never throws for a refusal.
ThreadSetup setUpThread(const ThreadRequest& request);

}  // namespace hapticd::realtime
