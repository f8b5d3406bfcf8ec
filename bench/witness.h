// A bare realtime thread beside a server: what the machine itself does to whoever wants to wake each
// millisecond.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <thread>

#include "bench/benchmark.h"

namespace hapticd::bench {

/// Sleeps and wakes at 1 kHz with a servo's rights, from construction to destruction.
class Witness {
 public:
  Witness();
  ~Witness();
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;

  /// Wakes more than 0.5 ms late since construction.
  std::uint64_t late() const noexcept { return late_; }

 private:
  void watch() noexcept;

  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> late_{0};
  std::thread thread_;
};

/// What the table says of a witness, against one while nothing disturbed.
Row witnessRow(std::uint64_t late, std::optional<std::uint64_t> undisturbed = {});

}  // namespace hapticd::bench
