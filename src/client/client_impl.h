// Implementation of hapticd::Client.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <tuple>

#include "client/callbacks.h"
#include "client/link.h"
#include "hapticd/client.h"

namespace hapticd {

struct HAPTICD_HIDDEN Client::Impl {
  Impl(const client::DeviceAddress& address, const ClientOptions& options);

  /// Sends a message of the device, stamped now, in the order of the calls.
  template <wire::WireMessage M>
  void send(const M& message) {
    link.send(client::wireNow(), sender, message, wire::Reliability::kReliable);
  }
  /// Sends a message at once, ahead of what is held. Throws ConnectionLost when nobody receives it; its text
  /// begins with what has failed.
  template <wire::WireMessage M>
  void sendAtOnce(const M& message, std::string_view failure) {
    link.sendNow(sender, message);
    if (!link.reachesServer()) throw ConnectionLost(std::string(failure) + ": " + link.whyNotConnected());
  }
  /// The same by datagram where there are any, for values that are sent repeatedly and worthless when late.
  template <wire::WireMessage M>
  void sendFast(const M& message) {
    link.send(client::wireNow(), sender, message, wire::Reliability::kLowLatency);
  }

  void waitConnected(Duration timeout);
  /// On a new connection, before anything else is sent: asks for the capabilities, and repeats the
  /// subscription, the report rate and the heartbeat, which belong to a connection.
  void greet();
  /// What the server must know of this client before it stops or re-arms.
  wire::Identify identity() const { return {.token = std::string_view(token), .key = key}; }
  /// Puts the key before a stop or a re-arm, so that the server knows this program again on its other
  /// connections, and on its next one. A token has told the key already.
  void sendKey() {
    if (token.empty() && link.connected()) link.putBeforeHeld(sender, identity());
  }
  /// Reads answers to greet() as they arrive.
  void onArrival(wire::MessageKind kind, wire::LocalSender from, wire::ByteView payload);
  /// Waits for the answer to the question for capabilities; false when the server does not answer.
  bool waitAnswered();
  /// Throws unless the server is one of this project: Unsupported, or ConnectError and ConnectionLost.
  void requireExtensions(std::string_view what);
  /// The same unless the device has the feature.
  void require(wire::Feature feature, std::string_view what);
  /// Sends a stop on a second connection, and waits until the server has confirmed it; see
  /// Client::stopForces().
  void stopBesideBacklog();
  /// Throws std::invalid_argument for a text that the wire would cut.
  static void requireFits(std::string_view call, std::string_view text, std::size_t most);
  bool has(wire::Feature feature) const { return offer && (offer->features & feature) != 0; }
  void sendRuns(int object, std::size_t first, std::span<const std::array<float, 3>> vertices,
                std::span<const std::array<std::uint32_t, 3>> triangles, const std::function<void()>& check);
  void uploadRuns(int object, std::span<const std::array<float, 3>> vertices,
                  std::span<const std::array<std::uint32_t, 3>> triangles,
                  const Callback<UploadProgress>& progress);
  template <class CornerAt>
  void uploadTriples(int object, std::size_t count, const Callback<UploadProgress>& progress,
                     CornerAt&& cornerAt);
  std::size_t poll(Duration timeout);

  void dispatch(const client::Arrival& arrival);
  /// Ignores a message that is not among these.
  template <class... M>
  void dispatchMessage(const client::Arrival& arrival, wire::MessageList<M...> all);
  /// Decodes a payload and handles it, or counts it as damaged.
  template <wire::WireMessage M>
  void decode(const client::Arrival& arrival);
  template <wire::WireMessage M>
  void handle(const client::Arrival& arrival, const M& message);
  void handle(const client::Arrival& arrival, const wire::ButtonChange& change);
  void handle(const client::Arrival& arrival, const wire::ButtonStates& states);
  void handle(const client::Arrival& arrival, const wire::Text& message);
  void handle(const client::Arrival& arrival, const wire::HandState& state);
  /// Counts a report, keeps it as the latest, and calls back.
  template <class Report>
  void deliver(const client::Arrival& arrival, Report report);
  template <class Report>
  client::CallbackList<Report>& callbacksFor() {
    return std::get<client::CallbackList<Report>>(callbacks);
  }

  std::string device;
  std::string server;
  ClientOptions options;
  client::Link link;
  wire::LocalSender sender;
  std::optional<wire::Capabilities> offer;  // by the server of this connection
  bool answered = false;                    // the server has answered, or does not know the question
  std::optional<wire::Subscribe> subscription;
  std::optional<double> updateRate_Hz;  // asked for after the subscription
  std::string token;                    // for a role; empty: none
  const std::uint64_t key;              // by which the server knows the connections of this client; not 0
  bool heartbeats = false;
  net::Subscription heartbeatTimer;
  LatestReports latest;  // of the connection that was reported last, which may have been followed by another
  std::uint64_t connectionsReported = 0;
  std::set<int> heldAtLoss;  // buttons that were down when a connection ended; until the next states
  std::array<ReportStatistics, kReportKinds> reports{};
  std::uint64_t damaged = 0;
  std::string firstError;  // that the server reported since the last poll
#define HAPTICD_LIST(name, Type, text) client::CallbackList<Type##Report>,
  std::tuple<HAPTICD_REPORTS(HAPTICD_LIST) client::CallbackList<ConnectionReport>> callbacks;
#undef HAPTICD_LIST
};

}  // namespace hapticd
