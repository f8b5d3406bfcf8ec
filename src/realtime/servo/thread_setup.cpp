#include "realtime/servo/thread_setup.h"

#include <grp.h>
#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "base/world.h"
#include "realtime/servo/flush_denormals.h"

namespace hapticd::realtime {
namespace {

constexpr std::size_t kStack_bytes = 256 * 1024;

bool hasCapability(unsigned capability) {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3]{};
  if (syscall(SYS_capget, &header, data) != 0) return false;
  return (data[capability / 32].effective >> (capability % 32) & 1U) != 0;
}

// For a thread of a vendor library: what the library gave it.
void readScheduling(SetupAnswer& answer) {
  answer.asked = true;
  int policy = SCHED_OTHER;
  sched_param parameters{};
  pthread_getschedparam(pthread_self(), &policy, &parameters);
  policy &= ~SCHED_RESET_ON_FORK;
  answer.granted = policy == SCHED_FIFO || policy == SCHED_RR;
  const std::string priority = std::to_string(parameters.sched_priority);
  answer.text = answer.granted ? "the thread of the vendor library has realtime priority " + priority
                               : "the thread of the vendor library has normal scheduling";
  if (!answer.granted) {
    answer.remedy =
        "give the program realtime rights (rtprio, or CAP_SYS_NICE), which most vendor libraries then use; "
        "or "
        "run the driver in a separate process (--isolate)";
  }
}

void requestScheduling(const ThreadRequest& request, SetupAnswer& answer) {
  if (request.keepScheduling) {
    readScheduling(answer);
    return;
  }
  answer.asked = request.realtime;
  if (!request.realtime) {
    answer.text = "normal scheduling, as configured";
    return;
  }
  sched_param parameters{};
  parameters.sched_priority = request.priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  answer.granted = error == 0;
  if (error == 0) {
    answer.text = "SCHED_FIFO priority " + std::to_string(request.priority);
  } else if (error == EINVAL) {
    answer.text = "priority " + std::to_string(request.priority) + " is not a SCHED_FIFO priority";
    answer.remedy = "choose a priority from 1 to 99";
  } else {
    rlimit limit{};
    getrlimit(RLIMIT_RTPRIO, &limit);
    answer.text = "normal scheduling: SCHED_FIFO priority " + std::to_string(request.priority) +
                  " was refused (" + std::strerror(error) + ", RLIMIT_RTPRIO is " +
                  std::to_string(limit.rlim_cur) + ")";
    answer.remedy = realtimeRemedy();
  }
}

void requestAffinity(const ThreadRequest& request, SetupAnswer& answer) {
  answer.asked = request.cpu >= 0;
  if (!answer.asked) {
    answer.text = "any CPU";
    return;
  }
  const std::string cpu = "CPU " + std::to_string(request.cpu);
  int error = EINVAL;
  if (request.cpu < CPU_SETSIZE) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(request.cpu), &set);
    error = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  }
  answer.granted = error == 0;
  answer.text =
      answer.granted ? cpu + " alone" : "any CPU: " + cpu + " was refused (" + std::strerror(error) + ")";
  if (!answer.granted) {
    answer.remedy = "choose a CPU from 0 to " + std::to_string(sysconf(_SC_NPROCESSORS_ONLN) - 1) +
                    " that the service's CPU set allows";
  }
}

void requestMemory(const ThreadRequest& request, SetupAnswer& answer) {
  answer.asked = request.lockMemory;
  if (!answer.asked) {
    answer.text = "memory may be paged out, as configured";
    return;
  }
  // Under a limit, mlockall() may succeed now and make later allocations fail: do not call it.
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  if (limit.rlim_cur != RLIM_INFINITY && !hasCapability(CAP_IPC_LOCK)) {
    answer.text =
        "memory may be paged out: RLIMIT_MEMLOCK is " + std::to_string(limit.rlim_cur / 1024) + " kB";
    answer.remedy = realtimeRemedy();
    return;
  }
  // MCL_ONFAULT locks pages when they are first touched: reserved address space costs nothing.
  answer.granted = mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0;
  answer.text = answer.granted ? "all memory is locked"
                               : std::string("memory may be paged out: mlockall: ") + std::strerror(errno);
  if (!answer.granted) answer.remedy = "free some memory, or run outside the container that limits it";
}

// Of the calling thread; that of the main thread is the limit of the system.
std::size_t stackSize() noexcept {
  std::size_t size = 2 * kStack_bytes;
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return size;
  pthread_attr_getstacksize(&attributes, &size);
  pthread_attr_destroy(&attributes);
  return size;
}

[[gnu::noinline]] void touchStack() {
  std::byte pages[kStack_bytes];
  volatile std::byte* page = pages;
  for (std::size_t i = 0; i < kStack_bytes; i += 4096) page[i] = std::byte{0};
}

}  // namespace

std::string ThreadSetup::complaints() const {
  std::string text;
  std::string remedies;
  for (const SetupAnswer* answer : all()) {
    if (!answer->asked || answer->granted) continue;
    text += std::string(answer->name) + ": " + answer->text + '\n';
    if (remedies.find(answer->remedy) == std::string::npos)
      remedies += (remedies.empty() ? "" : "; ") + answer->remedy;
  }
  return text.empty() ? text : text + "remedy: " + remedies;
}

std::string refusalOf(const ThreadSetup& setup) {
  return "the system refused what the servo thread of a real device requires\n" + setup.complaints() +
         "; --allow-no-rt starts without: late ticks then make the force rough";
}

std::string realtimeRemedy() {
  static constexpr const char* kGroup = "hapticd";
  group entry{};
  group* found = nullptr;
  std::vector<char> buffer(16384);
  getgrnam_r(kGroup, &entry, buffer.data(), buffer.size(), &found);
  if (found == nullptr)
    return "install the package hapticd and run 'sudo usermod -aG hapticd $USER', or run 'sudo "
           "scripts/setup_group.sh' of its sources; then log in again";
  return "sudo usermod -aG hapticd $USER, and log in again";
}

void requestShortTimeSlice() noexcept {
  // struct sched_attr of the kernel; older C libraries declare neither it nor the call.
  struct Attributes {
    std::uint32_t size = sizeof(Attributes);
    std::uint32_t policy = SCHED_OTHER;
    std::uint64_t flags = 1;  // SCHED_FLAG_RESET_ON_FORK
    std::int32_t nice = 0;
    std::uint32_t priority = 0;
    std::uint64_t slice_ns = 100'000;
    std::uint64_t deadline_ns = 0;
    std::uint64_t period_ns = 0;
  } attributes;
  if (base::world().threads.simulated()) return;
  if (sched_getscheduler(0) != SCHED_OTHER) return;  // the operator chose another policy
  attributes.nice = getpriority(PRIO_PROCESS, 0);
  syscall(SYS_sched_setattr, 0, &attributes, 0U);  // a refusal changes nothing
}

ThreadSetup setUpThread(const ThreadRequest& request) {
  ThreadSetup setup;
  if (base::world().threads.simulated()) {
    for (SetupAnswer* answer : {&setup.scheduling, &setup.memory}) {
      answer->granted = true;
      answer->text = "simulated";
    }
    return setup;
  }
  requestScheduling(request, setup.scheduling);
  requestAffinity(request, setup.affinity);
  requestMemory(request, setup.memory);
  prctl(PR_SET_TIMERSLACK, 1UL);  // without SCHED_FIFO the kernel may delay a wake-up by 50 µs
  if (request.keepScheduling) {
    setup.stack.text = "the stack of the vendor library";
  } else if (const std::size_t stack = stackSize(); stack < kStack_bytes + kStack_bytes / 4) {
    setup.stack = {"stack", true, false, "only " + std::to_string(stack / 1024) + " kB of stack",
                   "set the limit of stacks by 'ulimit -s 8192'"};
  } else {
    touchStack();
    setup.stack = {"stack", true, true, std::to_string(kStack_bytes / 1024) + " kB of stack are in memory",
                   ""};
  }
  setup.denormals.asked = true;
  setup.denormals.granted = FlushDenormals::kSupported;
  setup.denormals.text = FlushDenormals::kSupported ? "denormal numbers are flushed to zero in every tick"
                                                    : "denormal numbers are computed in full";
  if (!FlushDenormals::kSupported) setup.denormals.remedy = "not available on this processor";
  return setup;
}

}  // namespace hapticd::realtime
