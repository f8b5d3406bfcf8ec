// While nobody reads a connection, its owner still learns that the peer is gone.
#include <gtest/gtest.h>
#include <linux/filter.h>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kUnread = 1'000'000;

/// One raw peer of a connection that is paused from the start.
class PausedPeer : public testing::Test {
 protected:
  explicit PausedPeer(const ConnectionOptions& options = {}) : server_(loop_, options) {
    connection().start({.onBytes = [this](std::span<const std::byte> bytes) { received_ += textOf(bytes); },
                        .onPeerGone = [this](const std::string& reason) { gone_.push_back(reason); },
                        .onClosed = [this](const std::string& reason) { closed_ = reason; }});
    connection().pauseReading();
  }

  Connection& connection() { return server_.last().connection; }
  /// Sends without blocking, with the loop at work in between, until the system has taken all of it.
  void upload(std::size_t size) {
    const std::string chunk(64 * 1024, 'u');
    ASSERT_TRUE(pumpUntil(loop_, [&] {
      const ssize_t sent =
          ::send(peer_.fd(), chunk.data(), std::min(size, chunk.size()), MSG_DONTWAIT | MSG_NOSIGNAL);
      if (sent > 0) size -= static_cast<std::size_t>(sent);
      return size == 0;
    }));
  }
  bool reported() {
    return pumpUntil(loop_, [this] { return !gone_.empty(); });
  }

  Loop loop_;
  Server server_;
  RawSocket peer_ = server_.join();
  std::vector<std::string> gone_;
  std::string received_;
  std::string closed_;
};

TEST_F(PausedPeer, ItsEndBehindAMegabyteOfUnreadBytesIsReported) {
  upload(kUnread);
  peer_.close();
  ASSERT_TRUE(reported());
  EXPECT_EQ(gone_, std::vector<std::string>{"closed by the peer"});
  EXPECT_EQ(received_, "");
  EXPECT_EQ(closed_, "") << "the owner may still read the rest";
  connection().resumeReading();
  ASSERT_TRUE(pumpUntil(loop_, [&] { return !closed_.empty(); }));
  EXPECT_EQ(received_.size(), kUnread);
  EXPECT_EQ(closed_, "closed by the peer");
  EXPECT_EQ(gone_.size(), 1u);
}

TEST_F(PausedPeer, ItsResetIsReported) {
  upload(30'000);
  peer_.reset();
  ASSERT_TRUE(reported());
  EXPECT_EQ(gone_, std::vector<std::string>{"connection reset by the peer"});
  connection().resumeReading();
  ASSERT_TRUE(pumpUntil(loop_, [&] { return !closed_.empty(); }));
  EXPECT_EQ(received_.size(), 30'000u);
  EXPECT_EQ(closed_, "connection reset by the peer");
}

TEST_F(PausedPeer, AResetThatAWriteMeetsFirstIsReported) {
  connection().send(bytesOf("a report that the peer never reads"));
  connection().flush();
  upload(30'000);
  peer_.close();
  for (int i = 0; i < 3; ++i) {
    connection().send(bytesOf("more"));
    connection().flush();
  }
  EXPECT_FALSE(connection().isOpen());
  ASSERT_TRUE(reported());
  EXPECT_EQ(gone_, std::vector<std::string>{"connection reset by the peer"});
}

TEST_F(PausedPeer, TheOwnerMayEndTheConnectionInTheReport) {
  auto other = Connection::connect(loop_, server_.listener.local(), milliseconds(20000));
  bool ended = false;
  other.start({.onPeerGone = [&](const std::string&) {
    other = Connection();
    ended = true;
  }});
  other.pauseReading();
  ASSERT_TRUE(pumpUntil(loop_, [&] { return server_.sessions.size() == 2; }));
  server_.last().connection.close("done");
  EXPECT_TRUE(pumpUntil(loop_, [&] { return ended; }));
}

TEST_F(PausedPeer, OneThatLivesIsNotReported) {
  upload(kUnread);
  loop_.runFor(milliseconds(100));
  EXPECT_TRUE(gone_.empty());
  EXPECT_TRUE(connection().isOpen());
  connection().resumeReading();
  ASSERT_TRUE(pumpUntil(loop_, [&] { return received_.size() == kUnread; }));
}

TEST_F(PausedPeer, AnEndAfterManyPausesIsReported) {
  for (int i = 0; i < 10; ++i) {
    connection().resumeReading();
    loop_.runOnce(milliseconds(1));
    connection().pauseReading();
  }
  peer_.shutdownSend();
  ASSERT_TRUE(reported());
  EXPECT_EQ(gone_, std::vector<std::string>{"closed by the peer"});
}

class PausedAndWatched : public PausedPeer {
 protected:
  PausedAndWatched() : PausedPeer({.lossTimeout = milliseconds(200), .keepAlive = std::chrono::seconds(1)}) {}
};

TEST_F(PausedAndWatched, OneThatVanishesIsReported) {
  upload(30'000);
  sock_filter dropAll = BPF_STMT(BPF_RET | BPF_K, 0);
  const sock_fprog program{1, &dropAll};
  ASSERT_EQ(::setsockopt(peer_.fd(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program), 0);
  connection().send(bytesOf("a report"));
  connection().flush();
  ASSERT_TRUE(reported());
  EXPECT_EQ(gone_, std::vector<std::string>{"the peer is lost: it acknowledged nothing in time"});
  EXPECT_EQ(received_, "");
}

}  // namespace
}  // namespace hapticd::net
