#include "net/send_queue.h"

#include <gtest/gtest.h>

#include <array>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

std::string contents(const SendQueue& queue) {
  std::array<std::span<const std::byte>, 16> parts;
  std::string text;
  for (std::size_t i = 0, count = queue.gather(parts); i < count; ++i) {
    text += textOf(parts[i]);
  }
  return text;
}

TEST(SendQueue, KeepsOrderAndConsumesAcrossBuffers) {
  SendQueue queue(1000);
  queue.push(bufferOf("abc"), Delivery::reliable);
  queue.push(bufferOf("de"), Delivery::lowLatency);
  queue.push(bufferOf(""), Delivery::reliable);
  queue.push(bufferOf("fgh"), Delivery::reliable);
  EXPECT_EQ(contents(queue), "abcdefgh");
  EXPECT_EQ(queue.bytes(), 8u);
  EXPECT_EQ(queue.reliableBytes(), 6u);
  queue.consume(4);
  EXPECT_EQ(contents(queue), "efgh");
  EXPECT_EQ(queue.reliableBytes(), 3u);
  queue.consume(4);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.bytes(), 0u);
  EXPECT_EQ(queue.reliableBytes(), 0u);
}

TEST(SendQueue, AboveTheMarkTheNewestLowLatencyBufferReplacesThoseWaiting) {
  SendQueue queue(5);
  queue.push(bufferOf("11"), Delivery::lowLatency);
  queue.push(bufferOf("AA"), Delivery::reliable);
  queue.push(bufferOf("22"), Delivery::lowLatency);
  EXPECT_EQ(queue.droppedBuffers(), 0u);
  queue.push(bufferOf("33"), Delivery::lowLatency);
  EXPECT_EQ(contents(queue), "AA33");
  EXPECT_EQ(queue.droppedBuffers(), 2u);
  EXPECT_EQ(queue.droppedBytes(), 4u);
  EXPECT_EQ(queue.bytes(), 4u);
}

TEST(SendQueue, ReliableBytesAloneAboveTheMarkDropEveryLowLatencyBuffer) {
  SendQueue queue(3);
  queue.push(bufferOf("AAAA"), Delivery::reliable);
  queue.push(bufferOf("1"), Delivery::lowLatency);
  queue.push(bufferOf("BBBB"), Delivery::reliable);
  EXPECT_EQ(contents(queue), "AAAABBBB");
  EXPECT_EQ(queue.droppedBuffers(), 1u);
}

TEST(SendQueue, NeverDropsABufferThatIsPartlySent) {
  SendQueue queue(4);
  queue.push(bufferOf("1111"), Delivery::lowLatency);
  queue.push(bufferOf("22"), Delivery::lowLatency);
  queue.consume(1);
  queue.push(bufferOf("AAAA"), Delivery::reliable);
  queue.push(bufferOf("33"), Delivery::lowLatency);
  EXPECT_EQ(contents(queue), "111AAAA");
  EXPECT_EQ(queue.bytes(), 7u);
  EXPECT_EQ(queue.droppedBytes(), 4u);
  queue.consume(3);
  EXPECT_EQ(queue.reliableBytes(), 4u);
  queue.push(bufferOf("44"), Delivery::lowLatency);
  EXPECT_EQ(contents(queue), "AAAA44");
}

TEST(SendQueue, ReleasesABufferAsSoonAsItIsSent) {
  SendQueue queue(100);
  const auto first = bufferOf("first");
  const auto second = bufferOf("second");
  queue.push(first, Delivery::reliable);
  queue.push(second, Delivery::reliable);
  queue.push(second, Delivery::reliable);
  queue.consume(5);
  EXPECT_EQ(first.use_count(), 1);
  EXPECT_EQ(second.use_count(), 3);
  queue.clear();
  EXPECT_EQ(second.use_count(), 1);
  EXPECT_TRUE(queue.empty());
}

TEST(SendQueue, GatherGivesAtMostWhatThereIsRoomFor) {
  SendQueue queue(100);
  for (int i = 0; i < 20; ++i) {
    queue.push(bufferOf("ab"), Delivery::reliable);
  }
  std::array<std::span<const std::byte>, 7> parts;
  EXPECT_EQ(queue.gather(parts), 7u);
  queue.consume(39);
  EXPECT_EQ(queue.gather(parts), 1u);
  EXPECT_EQ(textOf(parts[0]), "b");
}

TEST(SendQueue, ManySmallBuffersCostMoreThanTheirBytes) {
  SendQueue queue(1 << 20);
  const auto byte = std::make_shared<const Buffer>(1);
  for (int i = 0; i < 1000; ++i) queue.push(byte, Delivery::reliable);
  EXPECT_EQ(queue.reliableBytes(), 1000U);
  EXPECT_EQ(queue.cost(), 1000 + 1000 * SendQueue::kItemBytes);
  queue.consume(999);
  EXPECT_EQ(queue.cost(), 1 + SendQueue::kItemBytes);
}

}  // namespace
}  // namespace hapticd::net
