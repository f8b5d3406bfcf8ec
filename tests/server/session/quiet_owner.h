#pragma once

#include <string>

#include "server/session/session.h"

namespace hapticd::server {

/// An owner of sessions that does nothing; tests override what they watch.
class QuietOwner : public SessionOwner {
 public:
  void onConnected(Session& /*session*/) override {}
  void onCaughtUp(Session& /*session*/) override {}
  void onSubscribed(Session& /*session*/, wire::LocalSender /*name*/) override {}
  void onMessage(Session& /*session*/, const wire::MessageReceived& /*message*/, base::Nanos) override {}
  void onWarning(const Session& /*session*/, const std::string& /*text*/) override {}
  void onNote(const Session& /*session*/, const std::string& /*text*/) override {}
  void onReadSlice() override {}
  void onReadEnd(Session& /*session*/) override {}
  void onPeerGone(Session& /*session*/, const std::string& /*reason*/) override {}
  void onHeartbeatAgain(Session& /*session*/) override {}
  void onEnding(Session& /*session*/) override {}
  void onClosed(Session& /*session*/, const std::string& /*reason*/) override {}
};

}  // namespace hapticd::server
