// MCAP files (https://mcap.dev/spec): channels of JSON messages in chunks with an index, without compression.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "record/archive.h"
#include "record/export_file.h"

namespace hapticd::record {

/// Writes one file. Readers that need no index can read a file that was not closed.
class McapWriter {
 public:
  using Nanos = base::Nanos;

  /// Throws RecordingError when the file cannot be written.
  explicit McapWriter(const std::filesystem::path& file, Unfinished unfinished = Unfinished::kept);

  /// Adds a kind of message with its JSON schema; returns its number.
  std::uint16_t addSchema(std::string_view name, std::string_view jsonSchema);
  /// Adds a channel of such messages; returns its number.
  std::uint16_t addChannel(std::uint16_t schema, std::string_view topic);
  /// `time` since the epoch, in nanoseconds.
  void add(std::uint16_t channel, Nanos time, std::string_view json);
  /// Writes what is left and the index. Throws RecordingError when the file could not be written whole.
  void close();

 private:
  struct ChunkIndex {
    std::uint64_t begin, end;  // times
    std::uint64_t offset, length;
    std::map<std::uint16_t, std::uint64_t> indexOffsets;
    std::uint64_t indexLength, size;
  };

  void writeChunk();
  void write(const Bytes& bytes);
  Bytes summary() const;

  ExportFile file_;
  std::uint64_t written_ = 0;
  Bytes definitions_;  // schemas and channels, as records
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint16_t schemas_ = 0;
  std::uint16_t channels_ = 0;

  Bytes chunk_;
  std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>> chunkMessages_;
  std::uint64_t chunkBegin_ = 0;
  std::uint64_t chunkEnd_ = 0;
  std::vector<ChunkIndex> chunks_;
};

}  // namespace hapticd::record
