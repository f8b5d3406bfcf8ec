// From arrivals to reports: decodes, counts, stores and delivers them.
#include <algorithm>
#include <cmath>

#include "base/printable.h"
#include "client/client_impl.h"
#include "wire/codec.h"
#include "wire/text.h"

namespace hapticd {
namespace {

using client::Arrival;

template <class Report>
constexpr ReportKind kKindOf = ReportKind::pose;
#define HAPTICD_KIND(name, Type, text) \
  template <>                          \
  constexpr ReportKind kKindOf<Type##Report> = ReportKind::name;
HAPTICD_REPORTS(HAPTICD_KIND)
#undef HAPTICD_KIND

// The wire has object numbers as doubles; -1 stands for everything that is no object number.
int objectNumber(double value) {
  return value >= 0 && value <= 2147483647.0 ? static_cast<int>(value) : -1;
}

void keep(LatestReports& latest, const PoseReport& r) {
  latest.pose[r.sensor] = r;
}
void keep(LatestReports& latest, const VelocityReport& r) {
  latest.velocity[r.sensor] = r;
}
void keep(LatestReports& latest, const ButtonReport& r) {
  latest.pressed[r.button] = r.pressed;
}
void keep(LatestReports& latest, const AnalogReport& r) {
  latest.analog = r;
}
void keep(LatestReports& latest, const ForceReport& r) {
  latest.force = r;
}
void keep(LatestReports& latest, const DepthReport& r) {
  latest.depth = r;
}
void keep(LatestReports& latest, const ContactPointReport& r) {
  latest.contactPoint = r;
}
void keep(LatestReports& latest, const TouchingReport& r) {
  latest.touching = r;
}
void keep(LatestReports& latest, const TouchedObjectReport& r) {
  latest.touchedObject = r;
}
void keep(LatestReports& latest, const AngleReport& r) {
  latest.angle = r;
}
void keep(LatestReports& latest, const TickReport& r) {
  latest.tick = r;
}
void keep(LatestReports& latest, const ContactsReport& r) {
  latest.contacts = r;
}
void keep(LatestReports& latest, const GuardReport& r) {
  latest.guard = r;
}
void keep(LatestReports& latest, const HandReport& r) {
  latest.hand = r;
}
template <class Other>
void keep(LatestReports&, const Other&) {}

PoseReport toReport(const wire::TrackerPosQuat& m) {
  return {{}, m.sensor, m.position, m.orientation};
}
VelocityReport toReport(const wire::TrackerVelocity& m) {
  return {{}, m.sensor, m.velocity, m.rotation, m.interval};
}
AccelerationReport toReport(const wire::TrackerAcceleration& m) {
  return {{}, m.sensor, m.acceleration, m.rotation, m.interval};
}
ToRoomReport toReport(const wire::TrackerToRoom& m) {
  return {{}, m.position, m.orientation};
}
UnitToSensorReport toReport(const wire::TrackerUnitToSensor& m) {
  return {{}, m.sensor, m.position, m.orientation};
}
WorkspaceReport toReport(const wire::TrackerWorkspace& m) {
  return {{}, m.min, m.max};
}
AnalogReport toReport(const wire::AnalogChannels& m) {
  return {{}, m.channels.values};
}
ForceReport toReport(const wire::Force& m) {
  return {{}, m.force};
}
TouchingReport toReport(const wire::IsTouching& m) {
  return {{}, m.touching != 0};
}
DepthReport toReport(const wire::Dop& m) {
  return {{}, m.depth};
}
ContactPointReport toReport(const wire::Scp& m) {
  return {{}, m.position, m.orientation};
}
TouchedObjectReport toReport(const wire::TouchedObject& m) {
  return {{}, m.object};
}
AngleReport toReport(const wire::Angle& m) {
  return {{}, m.angle, m.touching != 0};
}
ForceErrorReport toReport(const wire::ForceError& m) {
  return {{}, static_cast<hapticd::ForceError>(m.code)};
}
GuardReport toReport(const wire::GuardState& m) {
  return {{}, Trips(m.active), Trips(m.latched), m.armed != 0, m.stopped != 0};
}

TickReport toReport(const wire::TickReport& m) {
  return {{},
          m.tick,
          std::chrono::nanoseconds(m.time),
          m.revision,
          m.hand,
          m.proxy,
          m.velocity,
          m.orientation,
          m.force,
          m.depth,
          m.object,
          m.buttons,
          Trips(m.guardActive),
          Trips(m.guardLatched)};
}

// Ignores numbers at the end that do not make a complete contact.
ContactsReport toReport(const wire::ContactList& m) {
  ContactsReport report{{}, m.tick, std::chrono::nanoseconds(m.time), {}};
  constexpr std::size_t kNumbers = wire::ContactList::kNumbers;
  const std::vector<double>& n = m.contacts.values;
  for (std::size_t i = 0; i + kNumbers <= n.size(); i += kNumbers) {
    report.contacts.push_back({objectNumber(n[i]),
                               {n[i + 1], n[i + 2], n[i + 3]},
                               {n[i + 4], n[i + 5], n[i + 6]},
                               {n[i + 7], n[i + 8], n[i + 9]}});
  }
  return report;
}

// A contact whose number is none makes a message damaged.
bool numbersEveryContact(const wire::HandState& m) {
  constexpr std::size_t kNumbers = wire::HandState::kNumbers;
  const std::vector<double>& n = m.contacts.values;
  for (std::size_t i = 0; i + kNumbers <= n.size(); i += kNumbers) {
    if (!std::isfinite(n[i])) return false;
  }
  return true;
}

HandReport toReport(const wire::HandState& m) {
  HandReport report{{},
                    m.tick,
                    std::chrono::nanoseconds(m.time),
                    std::chrono::nanoseconds(m.contactsTime),
                    std::chrono::nanoseconds(m.forceTime),
                    m.position,
                    m.orientation,
                    m.velocity,
                    m.angularVelocity,
                    m.force,
                    m.heldForce,
                    m.energy,
                    std::nullopt,
                    m.buttons,
                    (m.flags & wire::kHandEnergySpent) != 0,
                    (m.flags & wire::kHandCorrectionsHeld) != 0,
                    Trips(m.guardActive),
                    {}};
  if ((m.flags & wire::kHandHasGripper) != 0) report.gripper_rad = m.gripper;
  constexpr std::size_t kNumbers = wire::HandState::kNumbers;
  const std::vector<double>& n = m.contacts.values;
  for (std::size_t i = 0; i + kNumbers <= n.size(); i += kNumbers) {
    report.contacts.push_back({static_cast<int>(std::clamp(n[i], -2147483648.0, 2147483647.0)),
                               {n[i + 1], n[i + 2], n[i + 3]},
                               {n[i + 4], n[i + 5], n[i + 6]},
                               n[i + 7]});
  }
  return report;
}

// The others are pongs, and commands, which only servers handle.
using MessagesForClients =
    wire::MessageList<wire::TrackerPosQuat, wire::TrackerVelocity, wire::TrackerAcceleration,
                      wire::TrackerToRoom, wire::TrackerUnitToSensor, wire::TrackerWorkspace,
                      wire::ButtonChange, wire::ButtonStates, wire::AnalogChannels, wire::Force,
                      wire::ForceError, wire::IsTouching, wire::Dop, wire::Scp, wire::TouchedObject,
                      wire::Angle, wire::Text, wire::TickReport, wire::ContactList, wire::HandState,
                      wire::GuardState>;

}  // namespace

template <class Report>
void Client::Impl::deliver(const Arrival& arrival, Report report) {
  report.time = client::toTimePoint(arrival.time);
  ReportStatistics& statistics = reports[static_cast<std::size_t>(kKindOf<Report>)];
  ++statistics.count;
  statistics.latency.add(
      std::chrono::duration_cast<std::chrono::microseconds>(arrival.arrived - report.time));
  keep(latest, report);
  callbacksFor<Report>().call(report);
}

template <wire::WireMessage M>
void Client::Impl::handle(const Arrival& arrival, const M& message) {
  deliver(arrival, toReport(message));
}

void Client::Impl::handle(const Arrival& arrival, const wire::ButtonChange& change) {
  heldAtLoss.erase(change.button);
  deliver(arrival, ButtonReport{{}, change.button, change.state != 0});
}

// Servers resend all button states periodically; report changes only, and once what a person let go while
// there was no connection.
void Client::Impl::handle(const Arrival& arrival, const wire::ButtonStates& states) {
  const auto isDown = [&](int button) {
    const auto index = static_cast<std::size_t>(button);
    return index < states.states.values.size() && states.states.values[index] != 0;
  };
  while (!heldAtLoss.empty()) {
    const int button = heldAtLoss.extract(heldAtLoss.begin()).value();
    if (!isDown(button)) deliver(arrival, ButtonReport{{}, button, false});
  }
  for (std::size_t i = 0; i < states.states.values.size(); ++i) {
    const int button = static_cast<int>(i);
    const bool pressed = states.states.values[i] != 0;
    if (latest.pressed[button] != pressed) deliver(arrival, ButtonReport{{}, button, pressed});
  }
}

void Client::Impl::handle(const Arrival& arrival, const wire::Text& message) {
  const std::string text = base::printable(message.text.text);
  if (message.severity >= wire::kTextError && firstError.empty()) firstError = text;
  const auto severity = static_cast<Severity>(std::min(message.severity, wire::kTextError));
  deliver(arrival, TextReport{{}, severity, text});
}

void Client::Impl::handle(const Arrival& arrival, const wire::HandState& state) {
  if (numbersEveryContact(state)) {
    deliver(arrival, toReport(state));
  } else {
    ++damaged;
  }
}

template <wire::WireMessage M>
void Client::Impl::decode(const Arrival& arrival) {
  if (const wire::Result<M> message = wire::decode<M>(arrival.bytes)) {
    handle(arrival, *message);
  } else {
    ++damaged;
  }
}

template <class... M>
void Client::Impl::dispatchMessage(const Arrival& arrival, wire::MessageList<M...> /*all*/) {
  static_cast<void>(((arrival.kind == wire::kindOf<M> && (decode<M>(arrival), true)) || ...));
}

void Client::Impl::dispatch(const Arrival& arrival) {
  if (arrival.what == Arrival::What::message) {
    if (arrival.sender == sender) dispatchMessage(arrival, MessagesForClients{});
    return;
  }
  const bool up = arrival.what == Arrival::What::connected;
  if (!up) {
    for (const auto& [button, pressed] : latest.pressed) {
      if (pressed) heldAtLoss.insert(button);
    }
    latest = {};
  } else {
    ++connectionsReported;
  }
  callbacksFor<ConnectionReport>().call({arrival.arrived, up, std::string(wire::asText(arrival.bytes))});
}

#define HAPTICD_ON(name, Type, text)                                     \
  Subscription Client::on##Type(Callback<Type##Report> callback) {       \
    return impl_->callbacksFor<Type##Report>().add(std::move(callback)); \
  }
HAPTICD_REPORTS(HAPTICD_ON)
HAPTICD_ON(connection, Connection, "connection")
#undef HAPTICD_ON

void Subscription::end() noexcept {
  if (const auto entry = entry_.lock()) entry->end();
}
bool Subscription::active() const noexcept {
  const auto entry = entry_.lock();
  return entry && entry->active();
}

std::string_view nameOf(ReportKind kind) noexcept {
#define HAPTICD_NAME(name, Type, text) text,
  static constexpr std::array<std::string_view, kReportKinds> kNames{HAPTICD_REPORTS(HAPTICD_NAME)};
#undef HAPTICD_NAME
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view nameOf(ForceError error) noexcept {
  switch (error) {
    case ForceError::valueOutOfRange:
      return "value out of range";
    case ForceError::dutyCycle:
      return "duty cycle";
    case ForceError::force:
      return "force";
    case ForceError::recovered:
      return "recovered";
    case ForceError::other:
      break;
  }
  return "other";
}

std::string_view nameOf(Severity severity) noexcept {
  static constexpr std::string_view kNames[] = {"normal", "warning", "error"};
  return kNames[static_cast<std::size_t>(severity)];
}

}  // namespace hapticd
