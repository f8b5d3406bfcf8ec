// The time from one process to the other when a driver is isolated, against a bare futex.
#include <linux/futex.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <climits>
#include <csignal>
#include <new>
#include <stdexcept>
#include <thread>

#include "bench/all.h"
#include "bench/servo_loop.h"
#include "bench/timing.h"
#include "device/isolation/device_host.h"
#include "device/isolation/isolated_device.h"

namespace hapticd::bench {
namespace {

constexpr std::int64_t kPost_ns = 1'000'000;  // from one count to the next

struct Word {
  std::atomic<std::uint32_t> count{0};
  std::atomic<std::int64_t> time_ns{0};
};

// Another process counts up a word each millisecond; a thread with the servo's rights waits for it.
Samples bareFutex(double seconds) {
  void* const memory = mmap(nullptr, sizeof(Word), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory");
  Word& word = *new (memory) Word;
  const pid_t poster = fork();
  if (poster == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    becomeRealtime();
    for (std::int64_t due = nowNs() + kPost_ns;; due = std::max(due + kPost_ns, nowNs())) {
      sleepUntilNs(due);
      word.time_ns = nowNs();
      word.count.fetch_add(1, std::memory_order_release);
      syscall(SYS_futex, &word.count, FUTEX_WAKE, INT_MAX, nullptr, nullptr, 0);
    }
  }
  Samples samples;
  std::thread waiter([&] {
    becomeRealtime();
    const auto wanted = static_cast<std::size_t>(seconds * 1e3);
    std::uint32_t seen = word.count;
    const timespec most{0, 10'000'000};
    for (std::size_t i = 0; i < wanted;) {
      syscall(SYS_futex, &word.count, FUTEX_WAIT, seen, &most, nullptr, 0);
      const std::uint32_t now = word.count.load(std::memory_order_acquire);
      if (std::exchange(seen, now) == now) continue;
      samples.add(1e-3 * static_cast<double>(nowNs() - word.time_ns));
      ++i;
    }
  });
  waiter.join();
  kill(poster, SIGKILL);
  waitpid(poster, nullptr, 0);
  munmap(memory, sizeof(Word));
  return samples;
}

Samples isolated(double seconds) {
  device::IsolatedDevice device({.command = {"/proc/self/exe", "--helper", "device-host"}});
  device.open();
  const auto wanted = static_cast<std::size_t>(seconds * 1e3);
  std::vector<double> times_us(wanted);
  std::atomic<std::size_t> count{0};
  device.start([&](base::Nanos now) {
    const std::size_t i = count;
    if (i == 0) becomeRealtime();
    device::DeviceState state;
    device.read(now, state);
    device.write(Vec3::Zero());
    if (i < wanted) times_us[i] = 1e-3 * static_cast<double>(device.postToTick());
    count = i + 1;
  });
  while (count < wanted) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  device.close();
  Samples samples;
  for (std::size_t i = 1; i < wanted; ++i) samples.add(times_us[i]);
  return samples;
}

}  // namespace

int hostStrokingDevice() {
  StrokingDevice device;
  return device::runDeviceHost(device, {.rate_Hz = 1000, .beforeFirstTick = [] { becomeRealtime(); }});
}

Outcome measureHandover(const Run& run) {
  Samples ours;
  Samples bare;
  const int rounds = static_cast<int>(run.seconds(6, 20, 60));
  for (int round = 0; round < rounds; ++round) {
    run.progress("round " + std::to_string(round + 1) + " of " + std::to_string(rounds));
    ours.add(isolated(1));
    bare.add(bareFutex(1));
  }
  Row row{"state of an isolated driver to the tick, blocking", "us", ours.summary(), bare.summary(), {}, {}};
  const std::string reason = realtimeGranted() ? "" : "no SCHED_FIFO";
  row.checks.push_back({"p50 ratio", row.ours.p50 / row.yardstick->p50, 1.2, false, reason});
  row.checks.push_back({"p99 ratio", row.ours.p99 / row.yardstick->p99, 1.2, false, reason});
  return {{row}, {}, {}};
}

}  // namespace hapticd::bench
