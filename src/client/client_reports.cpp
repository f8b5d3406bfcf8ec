// From arrivals to reports: decode, count, keep, call back.
#include "client/client_impl.h"
#include "wire/codec.h"
#include "wire/text.h"

namespace hapticd {
namespace {

using client::Arrival;

template <class Report>
constexpr ReportKind kKindOf = ReportKind::pose;
template <>
constexpr ReportKind kKindOf<VelocityReport> = ReportKind::velocity;
template <>
constexpr ReportKind kKindOf<AccelerationReport> = ReportKind::acceleration;
template <>
constexpr ReportKind kKindOf<ButtonReport> = ReportKind::button;
template <>
constexpr ReportKind kKindOf<AnalogReport> = ReportKind::analog;
template <>
constexpr ReportKind kKindOf<ForceReport> = ReportKind::force;
template <>
constexpr ReportKind kKindOf<DepthReport> = ReportKind::depth;
template <>
constexpr ReportKind kKindOf<ContactPointReport> = ReportKind::contactPoint;
template <>
constexpr ReportKind kKindOf<TouchingReport> = ReportKind::touching;
template <>
constexpr ReportKind kKindOf<TouchedObjectReport> = ReportKind::touchedObject;
template <>
constexpr ReportKind kKindOf<AngleReport> = ReportKind::angle;
template <>
constexpr ReportKind kKindOf<ForceErrorReport> = ReportKind::forceError;
template <>
constexpr ReportKind kKindOf<TextReport> = ReportKind::text;
template <>
constexpr ReportKind kKindOf<ToRoomReport> = ReportKind::toRoom;
template <>
constexpr ReportKind kKindOf<UnitToSensorReport> = ReportKind::unitToSensor;
template <>
constexpr ReportKind kKindOf<WorkspaceReport> = ReportKind::workspace;
template <>
constexpr ReportKind kKindOf<TickReport> = ReportKind::tick;
template <>
constexpr ReportKind kKindOf<ContactsReport> = ReportKind::contacts;
template <>
constexpr ReportKind kKindOf<GuardReport> = ReportKind::guard;

// A number of an object as a double on the wire; what is none is -1, as planes are.
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
  latest.contact_point = r;
}
void keep(LatestReports& latest, const TouchingReport& r) {
  latest.touching = r;
}
void keep(LatestReports& latest, const TouchedObjectReport& r) {
  latest.touched_object = r;
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
template <class Other>
void keep(LatestReports&, const Other&) {}

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
          m.guard_active,
          m.guard_latched};
}

// Numbers that are left over at the end would be of a contact that lacks some: those are not one.
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

}  // namespace

template <class Report>
void Client::Impl::deliver(const Arrival& arrival, Report report) {
  report.time = client::toTimePoint(arrival.time);
  ReportStatistics& statistics = reports[static_cast<std::size_t>(kKindOf<Report>)];
  ++statistics.count;
  statistics.latency.add(
      std::chrono::duration_cast<std::chrono::microseconds>(arrival.arrived - report.time));
  keep(latest, report);
  call(report);
}

template <wire::WireMessage M, class Use>
void Client::Impl::decode(const Arrival& arrival, Use&& use) {
  const wire::Result<M> message = wire::decode<M>(arrival.bytes);
  if (message) {
    use(*message);
  } else {
    ++damaged;
  }
}

void Client::Impl::dispatch(const Arrival& arrival) {
  if (arrival.what == Arrival::What::message) {
    if (arrival.sender == sender) dispatchMessage(arrival);
    return;
  }
  const bool up = arrival.what == Arrival::What::connected;
  if (!up) latest = {};
  call(ConnectionReport{arrival.arrived, up, std::string(wire::asText(arrival.bytes))});
}

// Servers tell all states now and then; only what differs is news.
void Client::Impl::handle(const Arrival& arrival, const wire::ButtonStates& states) {
  for (std::size_t i = 0; i < states.states.values.size(); ++i) {
    const int button = static_cast<int>(i);
    const bool pressed = states.states.values[i] != 0;
    if (latest.pressed[button] != pressed) deliver(arrival, ButtonReport{{}, button, pressed});
  }
}

void Client::Impl::dispatchMessage(const Arrival& a) {
  switch (a.kind) {
    case wire::kindOf<wire::TrackerPosQuat>:
      return decode<wire::TrackerPosQuat>(a, [&](const auto& m) {
        deliver(a, PoseReport{{}, m.sensor, m.position, m.orientation});
      });
    case wire::kindOf<wire::Force>:
      return decode<wire::Force>(a, [&](const auto& m) { deliver(a, ForceReport{{}, m.force}); });
    case wire::kindOf<wire::IsTouching>:
      return decode<wire::IsTouching>(a, [&](const auto& m) {
        deliver(a, TouchingReport{{}, m.touching != 0});
      });
    case wire::kindOf<wire::Dop>:
      return decode<wire::Dop>(a, [&](const auto& m) { deliver(a, DepthReport{{}, m.depth}); });
    case wire::kindOf<wire::Scp>:
      return decode<wire::Scp>(a, [&](const auto& m) {
        deliver(a, ContactPointReport{{}, m.position, m.orientation});
      });
    case wire::kindOf<wire::TouchedObject>:
      return decode<wire::TouchedObject>(a, [&](const auto& m) {
        deliver(a, TouchedObjectReport{{}, m.object});
      });
    case wire::kindOf<wire::Angle>:
      return decode<wire::Angle>(a, [&](const auto& m) {
        deliver(a, AngleReport{{}, m.angle, m.touching != 0});
      });
    case wire::kindOf<wire::TrackerVelocity>:
      return decode<wire::TrackerVelocity>(a, [&](const auto& m) {
        deliver(a, VelocityReport{{}, m.sensor, m.velocity, m.rotation, m.interval});
      });
    case wire::kindOf<wire::TrackerAcceleration>:
      return decode<wire::TrackerAcceleration>(a, [&](const auto& m) {
        deliver(a, AccelerationReport{{}, m.sensor, m.acceleration, m.rotation, m.interval});
      });
    case wire::kindOf<wire::ButtonChange>:
      return decode<wire::ButtonChange>(a, [&](const auto& m) {
        deliver(a, ButtonReport{{}, m.button, m.state != 0});
      });
    case wire::kindOf<wire::ButtonStates>:
      return decode<wire::ButtonStates>(a, [&](const auto& m) { handle(a, m); });
    case wire::kindOf<wire::AnalogChannels>:
      return decode<wire::AnalogChannels>(a, [&](const auto& m) {
        deliver(a, AnalogReport{{}, m.channels.values});
      });
    case wire::kindOf<wire::ForceError>:
      return decode<wire::ForceError>(a, [&](const auto& m) {
        deliver(a, ForceErrorReport{{}, static_cast<hapticd::ForceError>(m.code)});
      });
    case wire::kindOf<wire::Text>:
      return decode<wire::Text>(a, [&](const auto& m) {
        if (m.severity >= wire::kTextError && first_error.empty()) first_error = m.text.text;
        deliver(a,
                TextReport{{}, static_cast<Severity>(std::min(m.severity, wire::kTextError)), m.text.text});
      });
    case wire::kindOf<wire::TrackerToRoom>:
      return decode<wire::TrackerToRoom>(a, [&](const auto& m) {
        deliver(a, ToRoomReport{{}, m.position, m.orientation});
      });
    case wire::kindOf<wire::TrackerUnitToSensor>:
      return decode<wire::TrackerUnitToSensor>(a, [&](const auto& m) {
        deliver(a, UnitToSensorReport{{}, m.sensor, m.position, m.orientation});
      });
    case wire::kindOf<wire::TrackerWorkspace>:
      return decode<wire::TrackerWorkspace>(a, [&](const auto& m) {
        deliver(a, WorkspaceReport{{}, m.min, m.max});
      });
    case wire::kindOf<wire::TickReport>:
      return decode<wire::TickReport>(a, [&](const auto& m) { deliver(a, toReport(m)); });
    case wire::kindOf<wire::ContactList>:
      return decode<wire::ContactList>(a, [&](const auto& m) { deliver(a, toReport(m)); });
    case wire::kindOf<wire::GuardState>:
      return decode<wire::GuardState>(a, [&](const auto& m) {
        deliver(a, GuardReport{{}, m.active, m.latched, m.armed != 0, m.stopped != 0});
      });
    default:
      return;  // pongs, and what only servers listen to
  }
}

// Each adds to its list of the tuple.
#define HAPTICD_ON(Name)                                                                      \
  void Client::on##Name(Callback<Name##Report> callback) {                                    \
    std::get<Impl::Callbacks<Name##Report>>(impl_->callbacks).push_back(std::move(callback)); \
  }
HAPTICD_ON(Pose)
HAPTICD_ON(Velocity)
HAPTICD_ON(Acceleration)
HAPTICD_ON(Button)
HAPTICD_ON(Analog)
HAPTICD_ON(Force)
HAPTICD_ON(Depth)
HAPTICD_ON(ContactPoint)
HAPTICD_ON(Touching)
HAPTICD_ON(TouchedObject)
HAPTICD_ON(Angle)
HAPTICD_ON(ForceError)
HAPTICD_ON(Text)
HAPTICD_ON(ToRoom)
HAPTICD_ON(UnitToSensor)
HAPTICD_ON(Workspace)
HAPTICD_ON(Tick)
HAPTICD_ON(Contacts)
HAPTICD_ON(Guard)
HAPTICD_ON(Connection)
#undef HAPTICD_ON

std::string_view nameOf(ReportKind kind) noexcept {
  static constexpr std::array<std::string_view, kReportKinds> kNames{
      "pose",           "velocity",  "acceleration",   "button",   "analog",      "force", "depth",
      "contact point",  "touching",  "touched object", "angle",    "force error", "text",  "to room",
      "unit to sensor", "workspace", "tick",           "contacts", "guard"};
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
