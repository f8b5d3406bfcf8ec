// What is behind hapticd::Client.
#pragma once

#include <deque>
#include <optional>
#include <tuple>

#include "client/link.h"
#include "hapticd/client.h"

namespace hapticd {

struct Client::Impl {
  /// A deque, because callbacks that add callbacks must not move the one that runs.
  template <class Report>
  using Callbacks = std::deque<Callback<Report>>;

  Impl(const client::DeviceAddress& address, const ClientOptions& options);

  /// Sends a message of the device, stamped now; reliably, so that none overtakes or misses another.
  template <wire::WireMessage M>
  void send(const M& message) {
    link.send(client::wireNow(), sender, message, wire::Reliability::kReliable);
  }
  /// The same by datagram, for what is sent again and again and worth nothing when late.
  template <wire::WireMessage M>
  void sendFast(const M& message) {
    link.send(client::wireNow(), sender, message, wire::Reliability::kLowLatency);
  }

  void waitConnected(Duration timeout);
  /// On a new connection, before anything else is sent: asks what the server can do, and tells it again what
  /// belongs to a connection.
  void greet();
  void arriving(wire::MessageKind kind, wire::LocalSender from, wire::ByteView payload);
  /// Waits until the server has said what it can do; false when it does not answer.
  bool waitAnswered();
  /// Throws unless the device has the feature: Unsupported, or ConnectError and ConnectionLost.
  void require(wire::Feature feature, std::string_view what);
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
  void dispatchMessage(const client::Arrival& arrival);
  /// Decodes a payload, or counts it as damaged.
  template <wire::WireMessage M, class Use>
  void decode(const client::Arrival& arrival, Use&& use);
  void handle(const client::Arrival& arrival, const wire::ButtonStates& states);
  /// Counts a report, keeps it as the latest, and calls back.
  template <class Report>
  void deliver(const client::Arrival& arrival, Report report);
  /// Calls back; callbacks added meanwhile wait for the next report.
  template <class Report>
  void call(const Report& report) {
    auto& list = std::get<Callbacks<Report>>(callbacks);
    const std::size_t count = list.size();
    for (std::size_t i = 0; i < count; ++i) list[i](report);
  }

  std::string device;
  std::string server;
  ClientOptions options;
  client::Link link;
  wire::LocalSender sender;
  std::optional<wire::Capabilities> offer;  // of this connection's server
  bool answered = false;                    // whether it has told, or cannot tell
  std::optional<wire::Subscribe> subscription;
  bool heartbeats = false;
  net::Subscription heartbeat_timer;
  LatestReports latest;
  std::array<ReportStatistics, kReportKinds> reports{};
  std::uint64_t damaged = 0;
  std::string first_error;  // of the server, since the last poll
  std::tuple<Callbacks<PoseReport>, Callbacks<VelocityReport>, Callbacks<AccelerationReport>,
             Callbacks<ButtonReport>, Callbacks<AnalogReport>, Callbacks<ForceReport>, Callbacks<DepthReport>,
             Callbacks<ContactPointReport>, Callbacks<TouchingReport>, Callbacks<TouchedObjectReport>,
             Callbacks<AngleReport>, Callbacks<ForceErrorReport>, Callbacks<TextReport>,
             Callbacks<ToRoomReport>, Callbacks<UnitToSensorReport>, Callbacks<WorkspaceReport>,
             Callbacks<TickReport>, Callbacks<ContactsReport>, Callbacks<GuardReport>,
             Callbacks<ConnectionReport>>
      callbacks;
};

}  // namespace hapticd
