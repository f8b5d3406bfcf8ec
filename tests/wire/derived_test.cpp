// What is derived from the table, and the fuzzers' properties on recorded bytes.
#include <gtest/gtest.h>

#include <fstream>

#include "fuzz/wire_properties.h"
#include "wire/describe.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

TEST(Documents, AreWhatTheTableSays) {
  std::ifstream in(HAPTICD_TESTDATA "/../docs/wire-messages.md");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_EQ(text, messagesAsMarkdown()) << "stale: run wire_docs markdown > docs/wire-messages.md";
}

// The tables leave the device's part out: without it no server understands a name.
TEST(Documents, SayWhatAMessageIsCalledOnTheWire) {
  const std::string name(info(kindOf<Force>).name);
  EXPECT_EQ(name, "vrpn_ForceDevice Force");
  EXPECT_NE(messagesAsMarkdown().find('`' + name + '`'), std::string::npos);
}

TEST(Documents, PythonHasTheMessagesOfTheTable) {
  std::ifstream in(HAPTICD_TESTDATA "/../python/hapticd/_messages.py");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  EXPECT_EQ(text, messagesAsPython()) << "stale: run wire_docs python > python/hapticd/_messages.py";
}

TEST(Descriptions, HaveOffsetsThatFollowEachOther) {
  const std::vector<MessageDescription> messages = describeMessages();
  ASSERT_EQ(messages.size(), kMessageKinds);
  const MessageDescription& angle = messages[static_cast<std::size_t>(kindOf<Angle>)];
  ASSERT_EQ(angle.fields.size(), 2U);
  EXPECT_EQ(angle.fields[1].offset, 8U);
  EXPECT_EQ(angle.fields[1].type, "i16");
  EXPECT_EQ(angle.fields[0].unit, "deg");
}

TEST(FuzzSeeds, HoldTheProperties) {
  for (const char* file : {"tcp.c2s.tcp.bin", "tcp.s2c.tcp.bin", "udp.c2s.tcp.bin", "udp.s2c.tcp.bin",
                           "udp.c2s.udp.bin", "udp.s2c.udp.bin", "udp.lob.udp.bin"}) {
    const Bytes bytes = recorded(file);
    checkCodec(bytes);
    checkEndpoint(bytes);
    checkEndpoint(ByteView(bytes).first(bytes.size() - 1));
  }
  for (const char* file : {"udp.c2s.udp.bin", "udp.s2c.udp.bin"}) {
    for (const Bytes& datagram : recordedDatagrams(file)) checkCodec(datagram);
  }
  checkCodec({});
  checkEndpoint({});
}

}  // namespace
}  // namespace hapticd::wire
