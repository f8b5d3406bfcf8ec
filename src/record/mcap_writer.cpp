#include "record/mcap_writer.h"

#include <algorithm>

#include "base/printable.h"
#include "record/crc32.h"

namespace hapticd::record {
namespace {

constexpr std::size_t kChunkBytes = 1U << 20U;
constexpr unsigned char kMcapMagic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndexOp = 0x08,
  kStatistics = 0x0B,
  kDataEnd = 0x0F,
};

// Little-endian values, and records with their length.
class Out {
 public:
  template <Scalar T>
  Out& number(T value) {
    auto bits = static_cast<std::uint64_t>(value);
    for (std::size_t i = 0; i < sizeof(T); ++i, bits >>= 8U)
      bytes.push_back(static_cast<std::byte>(bits & 0xFFU));
    return *this;
  }
  Out& raw(ByteView view) {
    bytes.insert(bytes.end(), view.begin(), view.end());
    return *this;
  }
  Out& text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    return raw(std::as_bytes(std::span(value)));
  }
  Out& record(Opcode opcode, const Out& content) {
    number(static_cast<std::uint8_t>(opcode)).number(static_cast<std::uint64_t>(content.bytes.size()));
    return raw(content.bytes);
  }

  Bytes bytes;
};

ByteView magicBytes() {
  return std::as_bytes(std::span(kMcapMagic));
}

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& file, Unfinished unfinished) : file_(file, unfinished) {
  write(Out().raw(magicBytes()).record(kHeader, Out().text("").text("hapticd " HAPTICD_VERSION)).bytes);
}

void McapWriter::write(const Bytes& bytes) {
  written_ += bytes.size();
  file_.write(bytes);
}

std::uint16_t McapWriter::addSchema(std::string_view name, std::string_view jsonSchema) {
  const Bytes record =
      Out().record(kSchema, Out().number(++schemas_).text(name).text("jsonschema").text(jsonSchema)).bytes;
  definitions_.insert(definitions_.end(), record.begin(), record.end());
  chunk_.insert(chunk_.end(), record.begin(), record.end());
  return schemas_;
}

std::uint16_t McapWriter::addChannel(std::uint16_t schema, std::string_view topic) {
  constexpr std::uint32_t kNoMetadata = 0;
  const Bytes record = Out()
                           .record(kChannel, Out()
                                                 .number(++channels_)
                                                 .number(schema)
                                                 .text(base::utf8(topic))
                                                 .text("json")
                                                 .number(kNoMetadata))
                           .bytes;
  definitions_.insert(definitions_.end(), record.begin(), record.end());
  chunk_.insert(chunk_.end(), record.begin(), record.end());
  counts_[channels_] = 0;
  return channels_;
}

void McapWriter::add(std::uint16_t channel, Nanos time, std::string_view json) {
  const auto at = static_cast<std::uint64_t>(std::max<Nanos>(time, 0));
  chunkBegin_ = chunkMessages_.empty() ? at : std::min(chunkBegin_, at);
  chunkEnd_ = chunkMessages_.empty() ? at : std::max(chunkEnd_, at);
  chunkMessages_[channel].emplace_back(at, chunk_.size());
  const auto sequence = static_cast<std::uint32_t>(counts_[channel]++);
  const Bytes record = Out()
                           .record(kMessage, Out().number(channel).number(sequence).number(at).number(at).raw(
                                                 std::as_bytes(std::span(json))))
                           .bytes;
  chunk_.insert(chunk_.end(), record.begin(), record.end());
  if (chunk_.size() >= kChunkBytes) writeChunk();
}

void McapWriter::writeChunk() {
  if (chunk_.empty()) return;
  const std::uint64_t size = chunk_.size();
  const Bytes record = Out()
                           .record(kChunk, Out()
                                               .number(chunkBegin_)
                                               .number(chunkEnd_)
                                               .number(size)
                                               .number(crc32(chunk_))
                                               .text("")
                                               .number(size)
                                               .raw(chunk_))
                           .bytes;
  ChunkIndex index{chunkBegin_, chunkEnd_, written_, record.size(), {}, 0, size};
  write(record);
  const std::uint64_t indexes = written_;
  for (const auto& [channel, messages] : chunkMessages_) {
    index.indexOffsets[channel] = written_;
    Out list;
    for (const auto& [time, offset] : messages) list.number(time).number(offset);
    const auto bytes = static_cast<std::uint32_t>(list.bytes.size());
    write(Out().record(kMessageIndex, Out().number(channel).number(bytes).raw(list.bytes)).bytes);
  }
  index.indexLength = written_ - indexes;
  chunks_.push_back(std::move(index));
  chunk_.clear();
  chunkMessages_.clear();
}

Bytes McapWriter::summary() const {
  Out out;
  out.raw(definitions_);
  for (const ChunkIndex& c : chunks_) {
    Out offsets;
    for (const auto& [channel, offset] : c.indexOffsets) offsets.number(channel).number(offset);
    out.record(kChunkIndexOp, Out()
                                  .number(c.begin)
                                  .number(c.end)
                                  .number(c.offset)
                                  .number(c.length)
                                  .number(static_cast<std::uint32_t>(offsets.bytes.size()))
                                  .raw(offsets.bytes)
                                  .number(c.indexLength)
                                  .text("")
                                  .number(c.size)
                                  .number(c.size));
  }
  std::uint64_t messages = 0;
  Out counts;
  for (const auto& [channel, count] : counts_) {
    messages += count;
    counts.number(channel).number(count);
  }
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  for (const ChunkIndex& c : chunks_) {
    begin = &c == chunks_.data() ? c.begin : std::min(begin, c.begin);
    end = std::max(end, c.end);
  }
  constexpr std::uint32_t kNone = 0;
  out.record(kStatistics, Out()
                              .number(messages)
                              .number(schemas_)
                              .number(static_cast<std::uint32_t>(channels_))
                              .number(kNone)
                              .number(kNone)
                              .number(static_cast<std::uint32_t>(chunks_.size()))
                              .number(begin)
                              .number(end)
                              .number(static_cast<std::uint32_t>(counts.bytes.size()))
                              .raw(counts.bytes));
  return out.bytes;
}

void McapWriter::close() {
  writeChunk();
  write(Out().record(kDataEnd, Out().number(std::uint32_t{0})).bytes);
  const std::uint64_t summaryStart = written_;
  Bytes end = summary();
  // The checksum covers the summary and the footer up to itself.
  Out footer;
  footer.number(static_cast<std::uint8_t>(kFooter))
      .number(std::uint64_t{20})
      .number(summaryStart)
      .number(std::uint64_t{0});
  end.insert(end.end(), footer.bytes.begin(), footer.bytes.end());
  const std::uint32_t sum = crc32(end);
  write(end);
  write(Out().number(sum).raw(magicBytes()).bytes);
  file_.close();
}

}  // namespace hapticd::record
