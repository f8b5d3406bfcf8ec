// A file as a sequence of blocks, each with its length and a checksum: what was written before a crash stays
// readable, and a reader can name the damaged block.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/files.h"
#include "record/archive.h"

namespace hapticd::record {

/// What a block holds. Numbers are never used again.
enum class BlockKind : std::uint32_t {
  header = 1,
  scene = 2,
  publish = 3,
  ticks = 4,
  lost = 5,
  end = 6,
  law = 7,
  stream = 8,
  passivity = 9,
  marker = 10,
  memory = 11,
  remoteMemory = 12,
  left = 13,
  wallOffset = 14
};

inline constexpr std::size_t kMagicBytes = 8;
inline constexpr std::size_t kBlockHeadBytes = 12;

/// Appends a block: kind, length of the content, checksum of kind, length and content, content.
void appendBlock(Bytes& out, BlockKind kind, ByteView content);
/// The first bytes of every file.
ByteView magic();

/// Steps through the blocks of a file.
class BlockReader {
 public:
  struct Block {
    BlockKind kind{};
    std::uint64_t offset = 0;  ///< of its head in the file
    Bytes content;
  };

  /// Throws RecordingError when the file cannot be opened or is not a recording.
  explicit BlockReader(const std::filesystem::path& file);

  /// The next whole block; false at the end and where nothing whole follows.
  bool next(Block& block);
  /// Why next() was false before the end of the file, naming the byte; empty when it was the end.
  const std::string& damage() const noexcept { return damage_; }

 private:
  std::string read(Block& block, const std::string& where);

  std::unique_ptr<base::InputFile> file_;
  std::uint64_t size_ = 0;
  std::uint64_t offset_ = 0;
  std::string damage_;
};

}  // namespace hapticd::record
