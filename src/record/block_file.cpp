#include "record/block_file.h"

#include <array>
#include <cstring>
#include <system_error>

#include "base/world.h"
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

BlockReader::BlockReader(const std::filesystem::path& file) {
  const std::string name = "'" + file.string() + "'";
  std::array<std::byte, kMagicBytes> begin{};
  std::size_t got = 0;
  std::error_code none;
  const auto status = std::filesystem::status(file, none);
  if (std::filesystem::is_fifo(status) || std::filesystem::is_socket(status))
    throw RecordingError(name + " is a pipe: copy it to a file first");
  if (std::filesystem::is_other(status))
    throw RecordingError(name + " is a device, not a recording; 'hapticd serve --record FILE' writes one");
  try {
    file_ = base::world().files.open(file);
    size_ = file_->size();
    got = file_->read(begin);
  } catch (const std::system_error& error) {
    throw RecordingError("cannot read " + name + ": " + error.code().message());
  }
  if (got != kMagicBytes || std::memcmp(begin.data(), kMagic, kMagicBytes) != 0) {
    throw RecordingError(
        name +
        " is not a recording: it does not begin with 'HAPTICS'; 'hapticd serve --record FILE' "
        "writes recordings");
  }
  offset_ = kMagicBytes;
}

bool BlockReader::next(Block& block) {
  if (offset_ == size_ || !damage_.empty()) return false;
  const std::string where = " at byte " + std::to_string(offset_) + " of " + std::to_string(size_);
  try {
    damage_ = read(block, where);
  } catch (const std::system_error& error) {
    damage_ = "the block" + where + " cannot be read: " + error.code().message();
  }
  return damage_.empty();
}

// The damage; empty when the block is whole.
std::string BlockReader::read(Block& block, const std::string& where) {
  const std::uint64_t rest = size_ - offset_;
  std::array<std::byte, kBlockHeadBytes> head{};
  if (rest < kBlockHeadBytes || file_->read(head) != kBlockHeadBytes)
    return "the file is cut within a block" + where;
  if (std::memcmp(head.data(), kMagic, kMagicBytes) == 0) return "another recording begins" + where;
  const auto length = wire::loadBig<std::uint32_t>(head.data() + 4);
  if (length > rest - kBlockHeadBytes)
    return "the file is cut within a block" + where + ", or the length of the block is damaged";
  block.content.resize(length);
  if (file_->read(block.content) != length) return "the file is cut within a block" + where;
  if (wire::loadBig<std::uint32_t>(head.data() + 8) != checksum(head.data(), block.content))
    return "the block" + where + " is damaged: its checksum does not match";
  block.kind = static_cast<BlockKind>(wire::loadBig<std::uint32_t>(head.data()));
  block.offset = offset_;
  offset_ += kBlockHeadBytes + length;
  return {};
}

}  // namespace hapticd::record
