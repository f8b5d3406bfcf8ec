#include "zeroconf/background_search.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "zeroconf/find_servers.h"

namespace hapticd::zeroconf {
namespace {

constexpr base::Nanos kPatience = 3'000'000'000;

void search(int stopFd, const BackgroundSearch::Done& done) {
  base::MonotonicClock clock;
  std::vector<AnnouncedServer> servers;
  std::string reason;
  try {
    servers = findServers(clock, kPatience, stopFd);
  } catch (const std::runtime_error& error) {
    reason = error.what();
  }
  done(std::move(servers), std::move(reason));
}

}  // namespace

BackgroundSearch::BackgroundSearch()
    : stopFd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)), startFd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

BackgroundSearch::~BackgroundSearch() {
  ::eventfd_write(stopFd_, 1);
  thread_.join();
  ::close(startFd_);
  ::close(stopFd_);
}

void BackgroundSearch::start(Done done) {
  {
    const std::lock_guard lock(mutex_);
    done_ = std::move(done);
  }
  ::eventfd_write(startFd_, 1);
  if (!thread_.running())
    thread_ = base::BlockingThread({.name = "find-servers", .niceness = 10}, [this] { run(); });
}

void BackgroundSearch::run() {
  for (;;) {
    std::array<pollfd, 2> waits{{{stopFd_, POLLIN, 0}, {startFd_, POLLIN, 0}}};
    ::poll(waits.data(), waits.size(), -1);
    if (waits[0].revents != 0) return;
    eventfd_t starts = 0;
    ::eventfd_read(startFd_, &starts);
    Done done;
    {
      const std::lock_guard lock(mutex_);
      done = std::exchange(done_, nullptr);
    }
    if (done) search(stopFd_, done);
  }
}

}  // namespace hapticd::zeroconf
