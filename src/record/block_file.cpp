#include "record/block_file.h"

#include <cerrno>
#include <cstring>

#include "record/crc32.h"
#include "record/recording.h"

namespace hapticd::record {
namespace {

constexpr char kMagic[kMagicBytes + 1] = "HAPTICS\n";

// Of kind, length and content.
std::uint32_t checksum(const std::byte* head, ByteView content) {
  return crc32(content, crc32(ByteView(head, 8)));
}

}  // namespace

ByteView magic() {
  return std::as_bytes(std::span(kMagic, kMagicBytes));
}

void appendBlock(Bytes& out, BlockKind kind, ByteView content) {
  const std::size_t at = out.size();
  out.resize(at + kBlockHeadBytes);
  std::byte* head = out.data() + at;
  wire::storeBig(head, static_cast<std::uint32_t>(kind));
  wire::storeBig(head + 4, static_cast<std::uint32_t>(content.size()));
  wire::storeBig(head + 8, checksum(head, content));
  out.insert(out.end(), content.begin(), content.end());
}

BlockReader::BlockReader(const std::filesystem::path& file) : file_(std::fopen(file.c_str(), "rb")) {
  const std::string name = "'" + file.string() + "'";
  if (!file_) throw RecordingError("cannot read " + name + ": " + std::strerror(errno));
  std::error_code error;
  size_ = std::filesystem::file_size(file, error);
  if (error) throw RecordingError("cannot read " + name + ": " + error.message());
  char begin[kMagicBytes] = {};
  if (std::fread(begin, 1, kMagicBytes, file_.get()) != kMagicBytes ||
      std::memcmp(begin, kMagic, kMagicBytes) != 0) {
    throw RecordingError(name +
                       " is no session file: it does not begin with 'HAPTICS'; 'hapticd serve "
                       "--record FILE' writes one");
  }
  offset_ = kMagicBytes;
}

bool BlockReader::next(Block& block) {
  if (offset_ == size_ || !damage_.empty()) return false;
  const std::string where = " at byte " + std::to_string(offset_) + " of " + std::to_string(size_);
  const std::uint64_t rest = size_ - offset_;
  std::byte head[kBlockHeadBytes];
  if (rest < kBlockHeadBytes || std::fread(head, 1, kBlockHeadBytes, file_.get()) != kBlockHeadBytes) {
    damage_ = "the file is cut within a block" + where;
    return false;
  }
  const auto length = wire::loadBig<std::uint32_t>(head + 4);
  if (length > rest - kBlockHeadBytes) {
    damage_ = "the file is cut within a block" + where + ", or the length of the block is damaged";
    return false;
  }
  block.content.resize(length);
  if (std::fread(block.content.data(), 1, length, file_.get()) != length) {
    damage_ = "the block" + where + " cannot be read: " + std::strerror(errno);
    return false;
  }
  if (wire::loadBig<std::uint32_t>(head + 8) != checksum(head, block.content)) {
    damage_ = "the block" + where + " is damaged: its checksum is another";
    return false;
  }
  block.kind = static_cast<BlockKind>(wire::loadBig<std::uint32_t>(head));
  block.offset = offset_;
  offset_ += kBlockHeadBytes + length;
  return true;
}

}  // namespace hapticd::record
