// What one side of a conversation with VRPN said, read by VRPN's format alone, not by this project's wire
// code.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <map>
#include <ostream>
#include <string>
#include <vector>

namespace hapticd::test {

inline constexpr std::size_t kVrpnCookieBytes = 24;
inline constexpr std::size_t kVrpnHeaderBytes = 24;

struct VrpnMessage {
  std::string sender, type, payload;
  bool operator==(const VrpnMessage&) const = default;
};
inline std::ostream& operator<<(std::ostream& out, const VrpnMessage& said) {
  return out << said.sender << " | " << said.type << " | " << ::testing::PrintToString(said.payload);
}

// A stream of one side: cookie, descriptions of names, messages.
class VrpnStream {
 public:
  void feed(const std::string& bytes) {
    bytes_ += bytes;
    if (at_ == 0 && bytes_.size() >= kVrpnCookieBytes) at_ = kVrpnCookieBytes;
    while (at_ >= kVrpnCookieBytes && bytes_.size() >= at_ + kVrpnHeaderBytes) {
      const std::size_t length = static_cast<std::size_t>(number(0));
      const std::size_t next = at_ + kVrpnHeaderBytes + (length - kVrpnHeaderBytes + 7) / 8 * 8;
      if (bytes_.size() < next) return;
      take(number(12), number(16), bytes_.substr(at_ + kVrpnHeaderBytes, length - kVrpnHeaderBytes));
      at_ = next;
    }
  }
  const std::vector<VrpnMessage>& said() const { return said_; }
  /// How much had been said before anything but names, then at the end of each step.
  const std::vector<std::size_t>& stepEnds() const { return ends_; }
  std::size_t steps() const { return steps_; }

 private:
  std::int32_t number(std::size_t offset) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<unsigned char>(bytes_[at_ + offset + i]);
    return static_cast<std::int32_t>(value);
  }
  void take(std::int32_t sender, std::int32_t type, const std::string& payload) {
    if (type == -1 || type == -2) {
      (type == -1 ? senders_ : types_)[sender] = payload.substr(4, payload.find('\0', 4) - 4);
    }
    if (type < 0) return;
    const std::string& name = types_[type];
    if (name == "vrpn_Base ping_message") return;  // how often is a matter of time
    if (said_.empty()) ends_.push_back(at_);
    said_.push_back({senders_[sender], name, payload});
    if (name != "Room Step") return;
    ++steps_;
    ends_.push_back(at_ + kVrpnHeaderBytes + (payload.size() + 7) / 8 * 8);
  }

  std::string bytes_;
  std::size_t at_ = 0;
  std::map<std::int32_t, std::string> senders_, types_;
  std::vector<VrpnMessage> said_;
  std::vector<std::size_t> ends_;
  std::size_t steps_ = 0;
};

inline std::string recording(const std::string& file) {
  std::ifstream in(HAPTICD_TESTDATA "/" + file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void expectSame(const std::vector<VrpnMessage>& said, const std::vector<VrpnMessage>& expected) {
  EXPECT_EQ(said.size(), expected.size());
  for (std::size_t i = 0; i < std::min(said.size(), expected.size()); ++i) {
    ASSERT_EQ(said[i], expected[i]) << "message " << i;
  }
}

}  // namespace hapticd::test
