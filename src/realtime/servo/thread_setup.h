// Requests to the system that a 1 kHz thread depends on, the answers, and the remedies for refusals.
#pragma once

#include <array>
#include <string>

namespace hapticd::realtime {

/// What to request.
struct ThreadRequest {
  bool realtime = true;  ///< SCHED_FIFO
  /// A thread of a vendor library: reports its scheduling and changes neither that nor its stack.
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
  std::string text{};    ///< the present state
  std::string remedy{};  ///< how to get it granted; empty when granted or not requested
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
  /// Whether every request was granted.
  bool granted() const noexcept {
    for (const SetupAnswer* answer : all()) {
      if (answer->asked && !answer->granted) return false;
    }
    return true;
  }
  /// One line per refused request, then the remedies, each once.
  std::string complaints() const;
};

/// Why a loop that requires realtime rights does not start.
std::string refusalOf(const ThreadSetup& setup);

/// The one way to realtime rights and locked memory for the calling user: the group that the package creates.
std::string realtimeRemedy();

/// Requests a 0.1 ms scheduler slice for the calling thread (sched_setattr), so that it runs soon after a
/// wake-up. Needs no rights and takes no processor time from other threads. Threads that it starts get the
/// default slice. No effect before Linux 6.12.
void requestShortTimeSlice() noexcept;

/// Makes all requests for the calling thread. Allocates and makes system calls: call it before the loop. A
/// refusal is an answer, not an exception.
ThreadSetup setUpThread(const ThreadRequest& request);

}  // namespace hapticd::realtime
