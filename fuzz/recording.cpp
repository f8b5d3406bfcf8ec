// Untrusted recordings, read to the end: as they are, and as blocks with valid checksums, which no fuzzer
// guesses.
#include <algorithm>

#include "base/fake_world.h"
#include "fuzz/targets.h"
#include "record/fields.h"
#include "record/recording_reader.h"

namespace hapticd::fuzz {
namespace {

using record::BlockKind;
using record::Bytes;
using record::ByteView;

void readToTheEnd(ByteView bytes) {
  base::FakeFiles files;
  files.create("/recording", base::Existing::replace)->write(bytes);
  const base::World& world = base::world();
  const base::ScopedWorld scope({world.clock, world.threads, files, world.random});
  try {
    record::RecordingReader reader("/recording");
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
    const auto kind = static_cast<BlockKind>(static_cast<std::uint32_t>(data[0]) % 12);
    const std::size_t length =
        std::min<std::size_t>(wire::loadBig<std::uint16_t>(data.data() + 1), data.size() - 3);
    record::appendBlock(file, kind, data.subspan(3, length));
    data = data.subspan(3 + length);
  }
  return file;
}

}  // namespace

void recording(Input input) {
  readToTheEnd(input);
  readToTheEnd(withChecksums(input));
}

}  // namespace hapticd::fuzz
