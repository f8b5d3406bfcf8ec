#include "isolation_check.h"
#include "base/time.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "device/isolation/isolated_device.h"
#include "realtime/servo/thread_setup.h"
#include "server/station/devices.h"

namespace hapticd::apps {
namespace {

using base::Nanos;
using namespace std::chrono_literals;

constexpr int kRounds = 5;

// Times of one process and one loop, sorted.
std::vector<Nanos> measureRound(std::size_t ticks) {
  server::ServerConfig config;
  device::IsolatedDevice device(
      {.command = {"/proc/self/exe", server::kDeviceHostCommand, server::toToml(config)}});
  device.open();
  std::vector<Nanos> times(ticks);
  std::atomic<std::size_t> count{0};
  device.start([&](Nanos now) {
    if (count == 0) realtime::setUpThread({.lockMemory = false});
    device::DeviceState state;
    device.read(now, state);
    device.write(geometry::Vec3::Zero());
    if (count < times.size()) times[count] = device.postToTick();
    ++count;
  });
  while (count < ticks) std::this_thread::sleep_for(1ms);
  device.close();
  std::sort(times.begin(), times.end());
  return times;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

IsolationCheck measureIsolation(double seconds) {
  const auto ticks = static_cast<std::size_t>(std::max(20.0, std::ceil(1000 * seconds / kRounds)));
  std::vector<double> p50, p99, most;
  for (int i = 0; i < kRounds; ++i) {
    const std::vector<Nanos> times = measureRound(ticks);
    const auto at = [&](double share) {
      return 1e-3 *
             static_cast<double>(times[static_cast<std::size_t>(share * static_cast<double>(ticks - 1))]);
    };
    p50.push_back(at(0.5));
    p99.push_back(at(0.99));
    most.push_back(at(1));
  }
  return {kRounds, {median(p50), median(p99), median(most)}};
}

}  // namespace hapticd::apps
