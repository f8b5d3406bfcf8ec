// The encoded reports of all clients with the same subscription to one name.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "net/send_queue.h"
#include "server/reports/reporter.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {

/// A tick, and with what it is reported.
struct TimedTick {
  realtime::TickReport tick;
  ReportFrame frame;
  wire::Time time;
};

/// Encodes each tick once, as the changes since the one before: a chain of links. A client that has all links
/// but the last few gets these. One that was overtaken gets the state of the last link and, of the links that
/// it missed, only what must not be lost. Net thread; no clock and no socket.
class ReportGroup {
 public:
  using Position = std::uint64_t;  ///< number of links that a client has or has missed
  using Frames = std::shared_ptr<const net::Buffer>;

  ReportGroup(const DeviceConfig& config, int buttonCount, const ReportChoice& choice,
              const DeviceName& name);

  wire::LocalSender name() const noexcept { return name_; }

  /// Adds what the tick changed. `late`: a newer tick waits, see Reporter::skip().
  void add(const std::shared_ptr<const TimedTick>& tick, bool late);
  /// Adds the whole state of the first tick.
  void addFirst(const TimedTick& tick);
  void add(const wire::Message& message, wire::Time time);
  /// Makes a link of what was added since the last call; false when there was nothing.
  bool collect();

  /// The position of a client that has all links.
  Position end() const noexcept { return begin_ + links_.size(); }
  /// Forgets the links that all clients had before the last pass.
  void beginPass();

  /// What advance() did: number of low-latency sends, and of ticks that were due and omitted.
  struct Sent {
    std::size_t reports = 0;
    std::uint64_t skipped = 0;
  };
  /// Brings a client from its position to end() by send(Frames, net::Delivery). A client that misses more
  /// than `most` links with low-latency reports was overtaken.
  template <class Send>
  Sent advance(Position& position, std::size_t most, const Send& send) {
    Sent sent;
    const std::size_t from = position > begin_ ? static_cast<std::size_t>(position - begin_) : 0;
    for (std::size_t i = from; i < links_.size(); ++i) {
      sent.reports += links_[i].lowLatency ? 1 : 0;
      sent.skipped += links_[i].skipped;
    }
    const bool overtaken = sent.reports > most;
    for (std::size_t i = from; i < links_.size(); ++i) {
      if (!overtaken && links_[i].lowLatency) send(links_[i].lowLatency, net::Delivery::lowLatency);
      if (links_[i].reliable) send(links_[i].reliable, net::Delivery::reliable);
    }
    if (overtaken) {
      send(stateOfLastLink(), net::Delivery::lowLatency);
      sent.skipped += sent.reports - 1;
      sent.reports = 1;
    }
    position = end();
    return sent;
  }

  /// The state for a client that has just subscribed and gets all links from end() on: of the last reported
  /// tick, because the next link holds the changes since then, and what is reported with every tick of
  /// `newest`. Calls send(message, time of its tick).
  using SendMessage = std::function<void(const wire::Message&, wire::Time)>;
  void presentState(const TimedTick& newest, const SendMessage& send) const;

 private:
  struct Link {
    Frames lowLatency, reliable;
    std::uint64_t skipped = 0;  // ticks skipped before
  };

  void encode(const std::vector<Outgoing>& out, wire::Time time);
  const Frames& stateOfLastLink();

  const wire::LocalSender name_;
  Reporter reporter_;
  wire::FrameEncoder lowLatency_, reliable_;
  std::shared_ptr<const TimedTick> reported_;  // the last tick with low-latency reports
  std::vector<Outgoing> outgoing_;

  std::deque<Link> links_;
  Position begin_ = 0;   // number of the first link that is kept
  Position passed_ = 0;  // all clients have the links before
  std::uint64_t skipped_ = 0;
  Frames state_;  // of the last link; null until a client needs it
};

}  // namespace hapticd::server
