// Announces a server on the network while it exists.
#pragma once

#include <cstdint>

#include "base/thread.h"
#include "zeroconf/announced_server.h"

namespace hapticd::zeroconf {

/// Keeps an announcement at the Avahi daemon, over restarts of the daemon and of the system's bus, and under
/// another name ("... #2") when the name is taken. What fails is tried again. A thread of its own
/// waits for the daemon; nothing waits for that thread but the destructor, some seconds when the daemon
/// hangs.
class Announcer {
 public:
  /// `address`: the one that the server listens on, in host byte order, or net::kAnyAddress. It is announced
  /// on the interfaces from which that address is reached.
  Announcer(AnnouncedServer server, std::uint32_t address);
  ~Announcer();
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

 private:
  void run();

  AnnouncedServer server_;
  int interface_;
  int stopFd_;
  base::BlockingThread thread_;
};

}  // namespace hapticd::zeroconf
