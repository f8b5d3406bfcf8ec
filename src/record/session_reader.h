// A session file as its events, in the order in which they were written: a scene is always told of before the
// first tick that felt it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "record/block_file.h"
#include "record/session.h"
#include "record/tick_codec.h"

namespace hapticd::record {

class SessionReader {
 public:
  /// Reads the header. Throws SessionError when there is none that this version can read.
  explicit SessionReader(const std::filesystem::path& file);

  const SessionHeader& header() const noexcept { return header_; }

  /// The next event; false when there is no other. Throws SessionError for a block that is whole but holds
  /// what no session can, naming the byte.
  bool next(SessionEvent& event);

  /// After the last event: why the session ends there, when it was not ended in order. Empty when it was.
  std::string remark() const;

 private:
  void readHeader();
  bool readBlock(SessionEvent& event);
  template <class Event>
  void takeWhole(SessionEvent& event);
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path path_;
  BlockReader blocks_;
  SessionHeader header_;
  BlockReader::Block block_;
  std::optional<TickUnpacker> ticks_;  // of the present block
  std::uint32_t ticksOf_ = 0;
  bool ended_ = false;
};

}  // namespace hapticd::record
