// What clients stream to one device: remote contacts and held forces, from the wire to the servo.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "handoff/latest_value.h"
#include "realtime/remote/remote_input.h"
#include "realtime/servo/report.h"
#include "scene/config.h"
#include "scene/notice.h"
#include "server/session/refusal_codes.h"
#include "wire/messages.h"

namespace hapticd::server {

/// One device. Net thread; never waits for the scene: the next tick takes the newest value. Of each kind one
/// client streams at a time, until its last value has expired.
class StreamedInput {
 public:
  using Slot = handoff::LatestValue<realtime::RemoteInput>;

  /// `servo` must outlive this object; this is its only writer. `config` has damping and delays of the
  /// device.
  StreamedInput(Slot& servo, const scene::SceneConfig& config, const realtime::EnergyBudget& budget,
                bool rendersTorque)
      : servo_(servo), config_(config), budget_(budget), rendersTorque_(rendersTorque) {}

  /// What to tell the client; an empty text: nothing. At most one text per second, client and kind.
  struct Answer {
    bool taken = false;
    Refusal text;
  };
  /// `last`: the newest tick, for the frame of the world. `received` is on the servo clock.
  Answer on(scene::ClientId client, const wire::RemoteContacts& message, const realtime::TickReport& last,
            base::Nanos received);
  Answer on(scene::ClientId client, const wire::HeldForce& message, const realtime::TickReport& last,
            base::Nanos received);
  /// A held force in the device frame, from a client without a clock.
  Answer on(scene::ClientId client, const geometry::Vec3& force_N, base::Nanos lifetime,
            base::Nanos received);
  /// Its contacts fade out now, and its force ends.
  void clientGone(scene::ClientId client);

 private:
  enum class Kind { contacts, force };
  // How long messages took of late.
  struct Way {
    base::Nanos roundTrip = 0;
    base::Nanos longest = 1'000'000'000;  // of one message
    base::Nanos measuredAt = 0;
  };
  // The client whose values of a kind are felt.
  struct Stream {
    std::optional<scene::ClientId> client;
    base::Nanos until = 0;      // its last value expires
    std::int64_t newest = 0;    // its newest stamp
    base::Nanos offset = 0;     // smallest difference between receipt and stamp
    Way way, wayBefore;         // now, and before the messages that arrive together with the newest
    base::Nanos burst = 0;      // the first of these arrived
    base::Nanos stateTime = 0;  // of the newest
  };

  bool begin(Stream& stream, scene::ClientId client, std::int64_t time, base::Nanos received,
             Refusal& refusal);
  base::Nanos statedAt(Stream& stream, std::int64_t time, base::Nanos received) const;
  Answer answer(scene::ClientId client, Kind kind, base::Nanos now, bool taken, Refusal text);
  Answer hold(scene::ClientId client, std::int64_t time, const geometry::Vec3& force_N, base::Nanos lifetime,
              base::Nanos received, Refusal remark);
  void measureRoundTrip(std::int64_t stateTime, base::Nanos received);
  std::string keepWithinBounds(realtime::RemoteContactSet& set, const realtime::TickReport& last) const;
  void send() { servo_.write(input_); }

  Slot& servo_;
  const scene::SceneConfig config_;
  const realtime::EnergyBudget budget_;
  const bool rendersTorque_;
  realtime::RemoteInput input_;
  Stream contacts_, force_;
  std::map<std::pair<scene::ClientId, Kind>, base::Nanos> nextText_;
};

}  // namespace hapticd::server
