#include "reach_device.h"

#include "hapticd/error.h"

namespace hapticd::apps {

void reachDevice(client::Link& link, const client::DeviceAddress& address, wire::LocalSender device) {
  if (!link.waitConnected(kAnswerTime)) throw ConnectError(address.device + ": " + link.whyNotConnected());
  if (!link.waitHeard(device, kAnswerTime))
    throw ConnectError("no device '" + address.device + "' answers at " + address.server.text());
}

void reachDevice(client::Link& link, const client::DeviceAddress& address, wire::LocalSender device,
                 bool& isHapticd) {
  link.onUp = [&link, device] { link.sendNow(device, wire::QueryCapabilities{}); };
  link.onArrival = [&isHapticd](wire::MessageKind kind, wire::LocalSender, wire::ByteView) {
    isHapticd = isHapticd || kind == wire::kindOf<wire::Capabilities>;
  };
  reachDevice(link, address, device);
}

}  // namespace hapticd::apps
