#include "server/session/message_backlog.h"

#include <gtest/gtest.h>

#include <random>

namespace hapticd::server {
namespace {

std::vector<std::byte> bytesOf(wire::ByteView view) {
  return {view.begin(), view.end()};
}

wire::MessageReceived messageOf(std::int32_t number, const std::vector<std::byte>& payload) {
  wire::MessageReceived message;
  message.kind = wire::kindOf<wire::SetVertex>;
  message.local_sender = wire::LocalSender{number % 3};
  message.time = {static_cast<std::uint32_t>(number), 7};
  message.payload = payload;
  return message;
}

TEST(MessageBacklogTest, MessagesAreReturnedUnchangedAndInOrder) {
  MessageBacklog backlog;
  EXPECT_TRUE(backlog.empty());
  std::mt19937 random(1);
  std::vector<std::vector<std::byte>> sent;
  std::size_t next = 0;
  const auto popOne = [&] {
    const MessageBacklog::Entry entry = backlog.pop();
    const auto number = static_cast<std::int32_t>(next);
    EXPECT_EQ(entry.message.kind, wire::kindOf<wire::SetVertex>);
    EXPECT_EQ(entry.message.local_sender.value, number % 3);
    EXPECT_EQ(entry.message.time.seconds, next);
    EXPECT_EQ(entry.received, 1000 + number);
    EXPECT_EQ(bytesOf(entry.message.payload), sent[next]);
    ++next;
  };
  for (int i = 0; i < 2000; ++i) {
    sent.emplace_back(random() % 100, static_cast<std::byte>(random()));
    backlog.push(messageOf(i, sent.back()), 1000 + i);
    while (!backlog.empty() && random() % 2 == 0) popOne();
  }
  while (!backlog.empty()) popOne();
  EXPECT_EQ(next, sent.size());
  EXPECT_EQ(backlog.size(), 0U);
}

TEST(MessageBacklogTest, SizeCountsTheRemainingBytes) {
  MessageBacklog backlog;
  const std::vector<std::byte> payload(1000);
  backlog.push(messageOf(0, payload), 0);
  const std::size_t one = backlog.size();
  EXPECT_GE(one, payload.size());
  backlog.push(messageOf(1, payload), 0);
  EXPECT_EQ(backlog.size(), 2 * one);
  backlog.pop();
  EXPECT_EQ(backlog.size(), one);
}

}  // namespace
}  // namespace hapticd::server
