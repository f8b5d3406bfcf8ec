// Events of an endpoint as text, to compare what two endpoints saw.
#pragma once

#include <string>

#include "wire/peer.h"
#include "wire/text.h"

namespace hapticd::wire {

struct EventText {
  std::string operator()(const Connected& e) const {
    return "connected " + std::string(e.version) + " log " + std::to_string(e.log_mode);
  }
  std::string operator()(const SenderDescribed& e) const {
    return "sender " + std::to_string(e.id.value) + ' ' + inQuotes(e.name);
  }
  std::string operator()(const TypeDescribed& e) const {
    return "type " + std::to_string(e.id.value) + ' ' + inQuotes(e.name) + " kind " +
           std::to_string(static_cast<int>(e.kind));
  }
  std::string operator()(const MessageReceived& e) const {
    return "message " + std::string(e.typeName) + " from " + std::string(e.senderName) + " kind " +
           std::to_string(static_cast<int>(e.kind)) + " local " + std::to_string(e.local_sender.value) +
           " at " + std::to_string(e.time.seconds) + '.' + std::to_string(e.time.microseconds) + ' ' +
           std::string(asText(e.payload));
  }
  std::string operator()(const UdpDescribed& e) const {
    return "udp " + e.address.host + ' ' + std::to_string(e.address.port);
  }
  std::string operator()(const LogRequested& e) const {
    return "log " + std::to_string(e.request.mode) + ' ' + inQuotes(e.request.inName) + ' ' +
           inQuotes(e.request.outName);
  }
  std::string operator()(const Ignored& e) const {
    return "ignored: " + std::string(e.reason) + ' ' + std::to_string(e.value);
  }
  std::string operator()(const ProtocolError& e) const { return "error: " + std::string(e.reason); }
};

inline std::string eventText(const Event& event) {
  return std::visit(EventText{}, event);
}

}  // namespace hapticd::wire
