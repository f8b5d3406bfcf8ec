// A recording as its events, in the order of writing: the commands of a scene precede the first tick that saw
// them.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "record/block_file.h"
#include "record/recording.h"
#include "record/tick_codec.h"

namespace hapticd::record {

class RecordingReader {
 public:
  /// Reads the header. Throws RecordingError when this version cannot read it.
  explicit RecordingReader(const std::filesystem::path& file);

  const RecordingHeader& header() const noexcept { return header_; }

  /// Wall time minus servo time at a servo time, by what was read so far.
  Nanos wallOffsetAt(Nanos time) const;

  /// The next event; false at the end. Throws RecordingError, naming the byte, for a whole block with
  /// impossible content.
  bool next(RecordingEvent& event);

  /// After the last event: why the recording has no end; empty when it has one.
  std::string ending() const;
  /// The same, and what the recorder lost before.
  std::string remark() const;

 private:
  void readHeader();
  void readLaw();
  void readPassivity();
  bool readBlock(RecordingEvent& event);
  template <class Event>
  void takeWhole(RecordingEvent& event);
  void readMemory(MemoryEvent& memory);
  void readRemoteMemory();
  void readWallOffset();
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path path_;
  BlockReader blocks_;
  RecordingHeader header_;
  std::map<Nanos, Nanos> wallOffsets_;  // by the time from which on they hold
  BlockReader::Block block_;
  bool pending_ = false;               // block_ was read and not used
  std::optional<TickUnpacker> ticks_;  // of the present block
  std::uint32_t ticksOf_ = 0;
  std::map<std::uint32_t, realtime::ServoMemory> remote_;  // parts of memories that follow, by device
  std::array<std::uint64_t, 3> lost_{};                    // of each kind
  bool ended_ = false;
};

}  // namespace hapticd::record
