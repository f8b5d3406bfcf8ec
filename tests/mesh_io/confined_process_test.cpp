// What a child process that reads a foreign file can still do: send its result, and nothing else.
#include "mesh_io/confined_process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string_view>

namespace hapticd::mesh_io {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

std::string textOf(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void sendText(const ConfinedOutput& send, std::string_view text) {
  send(std::as_bytes(std::span(text)));
}

std::string errorOf(const ConfinedLimits& limits, const std::function<void(const ConfinedOutput&)>& work) {
  try {
    return "no error, but the output: " + textOf(runConfined(limits, work));
  } catch (const ConfinedError& error) {
    return error.what();
  }
}

TEST(ConfinedProcess, OutputArrivesWhole) {
  std::string sent(3'000'001, ' ');
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<char>(i % 251);
  EXPECT_EQ(textOf(runConfined({},
                               [&](const ConfinedOutput& send) {
                                 sendText(send, std::string_view(sent).substr(0, 1'000'000));
                                 sendText(send, std::string_view(sent).substr(1'000'000));
                               })),
            sent);
  EXPECT_TRUE(runConfined({}, [](const ConfinedOutput&) {}).empty());
}

TEST(ConfinedProcess, AnExceptionIsTheErrorInPrintableCharacters) {
  EXPECT_EQ(errorOf({}, [](const ConfinedOutput&) { throw std::runtime_error("bad\x1b[2J\nline"); }),
            "bad [2J line");
  EXPECT_LE(
      errorOf({}, [](const ConfinedOutput&) { throw std::runtime_error(std::string(5000, 'x')); }).size(),
      400U);
}

TEST(ConfinedProcess, ACrashIsAnError) {
  EXPECT_THAT(errorOf({}, [](const ConfinedOutput&) { std::abort(); }), HasSubstr("crashed (Aborted)"));
  EXPECT_THAT(errorOf({}, [](const ConfinedOutput&) { _exit(7); }), HasSubstr("failed"));
}

TEST(ConfinedProcess, AnEndlessLoopEndsAtTheTimeLimit) {
  volatile bool forEver = true;
  const auto loop = [&](const ConfinedOutput&) {
    while (forEver) {
    }
  };
  EXPECT_THAT(errorOf({.time_s = 0.3}, loop), HasSubstr("longer than 0.3 s"));
  EXPECT_THAT(errorOf({.time_s = 0.3}, [](const ConfinedOutput&) { pause(); }),
              AnyOf(HasSubstr("longer than"), HasSubstr("no error")))
      << "the filter may refuse pause()";
}

TEST(ConfinedProcess, EndlessOutputEndsAtItsLimit) {
  EXPECT_THAT(errorOf({.output_bytes = 1U << 20U},
                      [](const ConfinedOutput& send) {
                        for (const std::string piece(100'000, 'x');;) sendText(send, piece);
                      }),
              HasSubstr("more than 1 MiB"));
}

#ifndef HAPTICD_SANITIZED  // sanitizers map more than any limit
TEST(ConfinedProcess, MemoryEndsAtItsLimit) {
  EXPECT_THAT(errorOf({.memory_bytes = 64U << 20U},
                      [](const ConfinedOutput&) {
                        std::vector<std::unique_ptr<char[]>> all;
                        for (;;) all.push_back(std::make_unique<char[]>(1U << 20U));
                      }),
              HasSubstr("more than 64 MiB of memory"));
}
#endif

// A port of this process on the loopback.
class Listener {
 public:
  Listener() : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&address_), size) != 0 || listen(socket_, 4) != 0 ||
        getsockname(socket_, reinterpret_cast<sockaddr*>(&address_), &size) != 0)
      throw std::runtime_error("no listener");
  }
  ~Listener() { ::close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int descriptor() const { return socket_; }
  std::string connect() const {
    const int s = ::socket(AF_INET, SOCK_STREAM, 0);
    if (s < 0) return "no socket";
    const int result = ::connect(s, reinterpret_cast<const sockaddr*>(&address_), sizeof address_);
    ::close(s);
    return result == 0 ? "connected" : "no way";
  }

 private:
  int socket_;
  sockaddr_in address_{};
};

TEST(ConfinedProcess, NoNetworkByEitherBarrier) {
  const Listener listener;
  ASSERT_EQ(listener.connect(), "connected") << "from this process";
  const auto tryIt = [&](const ConfinedOutput& send) { sendText(send, listener.connect()); };
  int barriers = 0;
  for (const ConfinedLimits& limits : {ConfinedLimits{.systemCallFilter = false},
                                       ConfinedLimits{.networkNamespace = false}, ConfinedLimits{}}) {
    const std::string seen = errorOf(limits, tryIt);
    EXPECT_THAT(seen, AnyOf(HasSubstr("output: no socket"), HasSubstr("output: no way"),
                            HasSubstr("neither a network namespace nor a seccomp filter")));
    if (seen.find("output: ") != std::string::npos) ++barriers;
  }
  EXPECT_GT(barriers, 0) << "this machine has neither";
}

TEST(ConfinedProcess, WithoutABarrierNothingRuns) {
  EXPECT_THAT(errorOf({.networkNamespace = false, .systemCallFilter = false},
                      [](const ConfinedOutput& send) { sendText(send, "it ran"); }),
              HasSubstr("foreign files are not read on this machine"));
}

TEST(ConfinedProcess, NoInheritedDescriptorsNoFilesNoProcesses) {
  const Listener listener;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("hapticd_confined_" + std::to_string(::getpid()));
  const std::string seen = errorOf({.networkNamespace = false}, [&](const ConfinedOutput& send) {
    std::string can;
    struct stat inherited {};  // the number may be that of the output now
    if (fstat(listener.descriptor(), &inherited) == 0 && S_ISSOCK(inherited.st_mode)) can += "descriptor ";
    if (const int f = open(file.c_str(), O_WRONLY | O_CREAT, 0600); f >= 0) can += "write ";
    if (unlink(file.c_str()) == 0) can += "remove ";
    if (open("/proc/self/status", O_RDONLY) < 0) can += "not-even-read ";
    if (const pid_t child = fork(); child == 0) {
      _exit(0);
    } else if (child > 0) {
      can += "fork ";
    }
    if (kill(getppid(), 0) == 0) can += "signal ";
    if (fcntl(STDIN_FILENO, F_SETOWN, getppid()) == 0) can += "signal-by-a-descriptor ";
    if (int waiting = 0; ioctl(STDIN_FILENO, FIONREAD, &waiting) == 0) can += "type-into-a-terminal ";
    sendText(send, "{" + can + "}");
  });
  EXPECT_THAT(seen, AnyOf(HasSubstr("output: {}"), HasSubstr("neither a network namespace nor")));
  EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace hapticd::mesh_io
