// Untrusted recordings, read to the end: as they are, and as blocks with valid checksums, which no fuzzer
// guesses.
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include "record/fields.h"
#include "record/recording_reader.h"

namespace {

using namespace hapticd;
using record::BlockKind;
using record::Bytes;
using record::ByteView;

void read(const std::filesystem::path& path, ByteView bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return;
  std::fwrite(bytes.data(), 1, bytes.size(), file);
  std::fclose(file);
  try {
    record::RecordingReader reader(path);
    for (record::RecordingEvent event; reader.next(event);) {
    }
    static_cast<void>(reader.remark());
  } catch (const record::RecordingError&) {
  }
}

Bytes header() {
  record::RecordingHeader content;
  content.devices.resize(2);
  for (record::RecordedDevice& device : content.devices) device.names = {"Phantom"};
  Bytes bytes;
  record::Packer pack(bytes);
  pack.put(record::kFormatVersion);
  pack.put(content);
  return bytes;
}

// Kind, length in two bytes, content; again and again.
Bytes withChecksums(ByteView data) {
  Bytes file(record::magic().begin(), record::magic().end());
  record::appendBlock(file, BlockKind::header, header());
  while (data.size() >= 3) {
    const auto kind = static_cast<BlockKind>(static_cast<std::uint32_t>(data[0]) % 8);
    const std::size_t length =
        std::min<std::size_t>(wire::loadBig<std::uint16_t>(data.data() + 1), data.size() - 3);
    record::appendBlock(file, kind, data.subspan(3, length));
    data = data.subspan(3 + length);
  }
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("session_fuzz_" + std::to_string(::getpid()));
  const ByteView bytes = std::as_bytes(std::span(data, size));
  read(path, bytes);
  read(path, withChecksums(bytes));
  return 0;
}
