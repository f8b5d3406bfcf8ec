// A session file as its events, in the order in which they were written: a scene is always told of before the
// first tick that felt it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "record/block_file.h"
#include "record/recording.h"
#include "record/tick_codec.h"

namespace hapticd::record {

class RecordingReader {
 public:
  /// Reads the header. Throws RecordingError when there is none that this version can read.
  explicit RecordingReader(const std::filesystem::path& file);

  const RecordingHeader& header() const noexcept { return header_; }

  /// The next event; false when there is no other. Throws RecordingError for a block that is whole but holds
  /// what no session can, naming the byte.
  bool next(RecordingEvent& event);

  /// After the last event: why the session ends there, when it was not ended in order. Empty when it was.
  std::string remark() const;

 private:
  void readHeader();
  bool readBlock(RecordingEvent& event);
  template <class Event>
  void takeWhole(RecordingEvent& event);
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path path_;
  BlockReader blocks_;
  RecordingHeader header_;
  BlockReader::Block block_;
  std::optional<TickUnpacker> ticks_;  // of the present block
  std::uint32_t ticksOf_ = 0;
  bool ended_ = false;
};

}  // namespace hapticd::record
