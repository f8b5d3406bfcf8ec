// Mutates runs of messages by whole records (fuzz/whole_server.cpp), so that what follows a change keeps its
// meaning.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t maxSize);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kHead = 4;
constexpr std::size_t kLongestPayload = 0xFFFF;

struct Record {
  std::uint8_t client;
  std::uint8_t kind;
  Bytes payload;
  bool waits() const { return (client >> 2U & 3U) == 1; }
};

// Behind the first byte, which draws the path of the hand. A wait has its time in place of a length.
std::vector<Record> recordsIn(const std::uint8_t* data, std::size_t size) {
  std::vector<Record> records;
  for (std::size_t at = 1; at + kHead <= size;) {
    Record record{data[at], data[at + 1], {}};
    const std::size_t length = std::size_t{data[at + 2]} << 8U | data[at + 3];
    at += kHead;
    if (record.waits()) {
      record.payload = {data[at - 2], data[at - 1]};
    } else {
      const std::size_t there = std::min(length, size - at);
      record.payload.assign(data + at, data + at + there);
      at += there;
    }
    records.push_back(std::move(record));
  }
  return records;
}

std::size_t write(const std::vector<Record>& records, std::uint8_t* data, std::size_t maxSize) {
  std::size_t at = 1;
  for (const Record& record : records) {
    const std::size_t size = record.waits() ? 2 : record.payload.size();
    if (at + kHead + size > maxSize) break;
    data[at++] = record.client;
    data[at++] = record.kind;
    if (!record.waits()) {
      data[at++] = static_cast<std::uint8_t>(size >> 8U);
      data[at++] = static_cast<std::uint8_t>(size);
    }
    for (std::size_t i = 0; i < size; ++i) data[at++] = i < record.payload.size() ? record.payload[i] : 0;
  }
  return at;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t maxSize,
                                               unsigned seed) {
  std::minstd_rand random(seed);
  std::vector<Record> records = recordsIn(data, size);
  if (records.empty() || random() % 16 == 0) return LLVMFuzzerMutate(data, size, maxSize);
  const auto any = [&] { return random() % records.size(); };
  const std::size_t chosen = any();
  switch (random() % 8) {
    case 0:
      records.insert(records.begin() + static_cast<std::ptrdiff_t>(any()), Record(records[chosen]));
      break;
    case 1:
      records.erase(records.begin() + static_cast<std::ptrdiff_t>(chosen));
      break;
    case 2:
      std::swap(records[chosen], records[any()]);
      break;
    case 3:
      records[chosen].client = static_cast<std::uint8_t>(random());
      break;
    case 4:
      records[chosen].kind = static_cast<std::uint8_t>(random());
      break;
    default: {
      Bytes& payload = records[chosen].payload;
      const std::size_t before = payload.size();
      // In half of the cases the payload keeps its length, as most messages need.
      const std::size_t most = random() % 2 == 0 ? before : std::min(before + 64, kLongestPayload);
      payload.resize(std::max<std::size_t>(most, 1));
      payload.resize(LLVMFuzzerMutate(payload.data(), before, payload.size()));
    }
  }
  return write(records, data, maxSize);
}
