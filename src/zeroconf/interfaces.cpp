#include "zeroconf/interfaces.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include "net/endpoint.h"
#include "zeroconf/avahi.h"

namespace hapticd::zeroconf {

int interfaceWith(std::uint32_t address) {
  int index = kAnyInterface;
  ifaddrs* all = nullptr;
  if (address == net::kAnyAddress || ::getifaddrs(&all) != 0) return index;
  for (const ifaddrs* a = all; a != nullptr; a = a->ifa_next) {
    if (a->ifa_addr == nullptr || a->ifa_addr->sa_family != AF_INET) continue;
    if (ntohl(reinterpret_cast<const sockaddr_in*>(a->ifa_addr)->sin_addr.s_addr) == address)
      index = static_cast<int>(::if_nametoindex(a->ifa_name));
  }
  ::freeifaddrs(all);
  return index;
}

}  // namespace hapticd::zeroconf
