// Ticks as bytes: one block holds a run of ticks.
#pragma once

#include "realtime/servo/tick_record.h"
#include "record/archive.h"

namespace hapticd::record {

/// Appends the ticks of one run. The placement of the device and the counts of the guard are written with the
/// first tick and when they change.
class TickPacker {
 public:
  void add(const realtime::TickRecord& tick, Bytes& out);
  /// The next tick begins a run.
  void restart() noexcept { first_ = true; }

 private:
  bool first_ = true;
  realtime::TickReport before_;
};

/// Appends what was streamed.
void packStream(const realtime::StreamRecord& stream, Bytes& out);
/// Takes one; false when it is damaged.
bool unpackStream(Unpacker& in, realtime::StreamRecord& stream);

/// Appends what a servo knew.
void packMemory(const realtime::ServoMemory& memory, Bytes& out);
/// Takes one; false when it is damaged.
bool unpackMemory(Unpacker& in, realtime::ServoMemory& memory);
/// The part of it that has a block of its own.
void packRemoteMemory(const realtime::ServoMemory& memory, Bytes& out);
/// Sets `tick` and `remote`; false for a damaged one.
bool unpackRemoteMemory(Unpacker& in, realtime::ServoMemory& memory);

/// Takes the ticks of one run.
class TickUnpacker {
 public:
  explicit TickUnpacker(ByteView run) : in_(run) {}

  /// The next one; false at the end of the run, or when it is damaged.
  bool next(realtime::TickRecord& tick);
  /// False when the run ended within a tick or has an impossible value.
  bool ok() const noexcept { return ok_; }

 private:
  Unpacker in_;
  bool ok_ = true;
  realtime::TickReport before_;
};

}  // namespace hapticd::record
