// Ticks to bytes: a run of them in one block, each as little longer than its numbers as is simple.
#pragma once

#include "realtime/servo/tick_record.h"
#include "record/archive.h"

namespace hapticd::record {

/// Appends ticks of one run. What seldom changes (the placement of the device, the guard's counts) is written
/// when it does, and with the first.
class TickPacker {
 public:
  void add(const realtime::TickRecord& tick, Bytes& out);
  /// The next tick begins a run.
  void restart() noexcept { first_ = true; }

 private:
  bool first_ = true;
  realtime::TickReport before_;
};

/// Takes the ticks of one run.
class TickUnpacker {
 public:
  explicit TickUnpacker(ByteView run) : in_(run) {}

  /// The next one; false at the end of the run, or when it is damaged.
  bool next(realtime::TickRecord& tick);
  /// False when the run ended within a tick or holds what no tick can.
  bool ok() const noexcept { return ok_; }

 private:
  Unpacker in_;
  bool ok_ = true;
  realtime::TickReport before_;
};

}  // namespace hapticd::record
