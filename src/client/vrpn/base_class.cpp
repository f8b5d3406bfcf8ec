#include "hapticd/vrpn/vrpn_BaseClass.h"

#include <algorithm>
#include <cstring>
#include <mutex>
#include <utility>
#include <vector>

#include "base/printable.h"
#include "client/vrpn/messages.h"
#include "hapticd/vrpn/vrpn_Text.h"

namespace wire = hapticd::wire;
using hapticd::client::receiveMessage;
using hapticd::client::sendMessage;

namespace {

// Neither is ever destroyed: a device may be in a variable that is destroyed later.
vrpn_TextPrinter& systemPrinter() {
  static auto& printer = *new vrpn_TextPrinter;
  return printer;
}
std::vector<vrpn_TextPrinter*>& printers() {
  static auto& all = *new std::vector<vrpn_TextPrinter*>;
  return all;
}

// Of the list of printers and of their fields: a device belongs to one thread, a printer to all.
std::mutex printing;

constexpr int kSilenceWarning_s = 3;
constexpr int kSilenceInterval_s = 10;

// Of no connection: that of a file has the time of its messages.
timeval wallTime() {
  timeval now{};
  vrpn_gettimeofday(&now);
  return now;
}

}  // namespace

vrpn_TextPrinter& vrpn_System_TextPrinter = systemPrinter();

vrpn_TextPrinter::vrpn_TextPrinter() {
  const std::lock_guard lock(printing);
  printers().push_back(this);
}

vrpn_TextPrinter::~vrpn_TextPrinter() {
  const std::lock_guard lock(printing);
  std::erase(printers(), this);
}

void vrpn_TextPrinter::set_min_level_to_print(vrpn_TEXT_SEVERITY severity, vrpn_uint32 level) {
  const std::lock_guard lock(printing);
  severity_ = severity;
  level_ = level;
}

void vrpn_TextPrinter::set_ostream_to_use(FILE* stream) {
  const std::lock_guard lock(printing);
  stream_ = stream;
}

void vrpn_TextPrinter::add(vrpn_BaseClassUnique* device) {
  const std::lock_guard lock(printing);
  if (std::find(devices_.begin(), devices_.end(), device) == devices_.end()) devices_.push_back(device);
}

int vrpn_TextPrinter::add_object(vrpn_BaseClass* device) {
  if (!device) return -1;
  add(device);
  return 0;
}

void vrpn_TextPrinter::remove_object(vrpn_BaseClass* device) {
  if (!device) return;
  const std::lock_guard lock(printing);
  std::erase_if(devices_, [&](const vrpn_BaseClassUnique* d) { return d->isSameDevice(*device); });
}

// Several objects of one device receive the same text: the first of them prints it.
void vrpn_TextPrinter::print(const vrpn_BaseClassUnique* device, const vrpn_HANDLERPARAM& p) const {
  const auto first = std::find_if(devices_.begin(), devices_.end(),
                                  [&](const vrpn_BaseClassUnique* d) { return d->isSameDevice(*device); });
  if (!stream_ || first == devices_.end() || *first != device) return;
  receiveMessage<wire::Text>(p, [&](const wire::Text& m) {
    const auto minimum = static_cast<vrpn_uint32>(severity_);
    if (m.severity < minimum || (m.severity == minimum && m.level < level_)) return;
    const char* kinds[] = {"message", "warning", "error"};
    fprintf(stream_, "VRPN: %s of %s: %s\n", kinds[std::min(m.severity, 2U)], device->d_servicename,
            hapticd::base::printable(m.text.text).c_str());
  });
}

void vrpn_BaseClassUnique::open(const char* name, vrpn_Connection* connection) {
  if (d_servicename) return;  // by another class of this device
  d_servicename = vrpn_copy_service_name(name);
  d_connection = connection;
  if (d_connection) {
    d_connection->addReference();
  } else {
    d_connection = vrpn_get_connection_by_name(name);
  }
  if (!d_connection) return;
  silentSince_ = wallTime();
  d_sender_id = d_connection->registerDevice(d_servicename);
  if (d_sender_id < 0) {  // a name that is refused is none: the number stands for all devices
    std::exchange(d_connection, nullptr)->removeReference();
    return;
  }
  d_text_message_id = d_connection->register_message_type("vrpn_Base text_message");
  d_ping_message_id = d_connection->register_message_type("vrpn_Base ping_message");
  d_pong_message_id = d_connection->register_message_type("vrpn_Base pong_message");
  systemPrinter().add(this);
  register_autodeleted_handler(d_text_message_id, handleText, this, d_sender_id);
}

vrpn_BaseClassUnique::~vrpn_BaseClassUnique() {
  {
    const std::lock_guard lock(printing);
    for (vrpn_TextPrinter* printer : printers()) std::erase(printer->devices_, this);
  }
  if (d_connection) {
    for (const Registered& r : registered_)
      d_connection->unregister_handler(r.type, r.handler, r.userdata, r.sender);
    d_connection->removeReference();
  }
  delete[] d_servicename;
}

int vrpn_BaseClassUnique::handleText(void* self, vrpn_HANDLERPARAM p) {
  const std::lock_guard lock(printing);
  for (const vrpn_TextPrinter* printer : printers())
    printer->print(static_cast<vrpn_BaseClassUnique*>(self), p);
  return 0;
}

int vrpn_BaseClassUnique::handlePing(void* self, vrpn_HANDLERPARAM) {
  const auto* device = static_cast<vrpn_BaseClassUnique*>(self);
  sendMessage(device->d_connection, device->d_sender_id, wire::Pong{});
  return 0;
}

int vrpn_BaseClassUnique::register_autodeleted_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler,
                                                       void* userdata, vrpn_int32 sender) {
  if (!d_connection || d_connection->register_handler(type, handler, userdata, sender) != 0) return -1;
  registered_.push_back({type, handler, userdata, sender});
  return 0;
}

int vrpn_BaseClassUnique::send_text_message(const char* text, timeval time, vrpn_TEXT_SEVERITY severity,
                                            vrpn_uint32 level) {
  if (std::strlen(text) >= vrpn_MAX_TEXT_LEN) {
    fprintf(stderr, "VRPN: a text of %zu characters, at most %u: not sent\n", std::strlen(text),
            vrpn_MAX_TEXT_LEN - 1);
    return -1;
  }
  sendMessage(d_connection, d_sender_id, wire::Text{static_cast<std::uint32_t>(severity), level, text},
              wire::Reliability::kReliable, &time);
  return d_connection ? 0 : -1;
}

void vrpn_BaseClassUnique::server_mainloop() {
  if (std::exchange(started_, true)) return;
  register_autodeleted_handler(d_ping_message_id, handlePing, this, d_sender_id);
}

void vrpn_BaseClassUnique::client_mainloop() {
  if (!d_connection) return;
  // A link pings the devices of its server; those of this program are asked for their state here.
  if (!d_connection->link() && !std::exchange(started_, true)) {
    sendMessage(d_connection, d_sender_id, wire::Ping{});
  }
  d_connection->mainloop();
  const timeval now = wallTime();
  const bool heard = d_connection->heard(d_sender_id);
  if (heard) {
    silentSince_ = now;
    warned_s_ = 0;
    return;
  }
  const auto silent_s = static_cast<int>(vrpn_TimevalDurationSeconds(now, silentSince_));
  if (shutup || silent_s < kSilenceWarning_s || (warned_s_ > 0 && silent_s < warned_s_ + kSilenceInterval_s))
    return;
  warned_s_ = silent_s;
  fprintf(stderr, "VRPN: no answer of %s for %d s\n", d_servicename, silent_s);
}

vrpn_BaseClass::vrpn_BaseClass(const char* name, vrpn_Connection* connection) {
  open(name, connection);
}

vrpn_BaseClass::~vrpn_BaseClass() = default;

int vrpn_BaseClass::init() {
  return register_senders() == 0 && register_types() == 0 ? 0 : -1;
}

void vrpn_BaseClass::listen(const char* type, vrpn_MESSAGEHANDLER handler, void* self) {
  if (d_connection) {
    register_autodeleted_handler(d_connection->register_message_type(type), handler, self, d_sender_id);
  }
}

vrpn_Text_Receiver::vrpn_Text_Receiver(const char* name, vrpn_Connection* connection)
    : vrpn_BaseClass(name, connection) {
  listen("vrpn_Base text_message", handleMessage, this);
}

int vrpn_Text_Receiver::handleMessage(void* self, vrpn_HANDLERPARAM p) {
  return receiveMessage<wire::Text>(p, [&](const wire::Text& m) {
    vrpn_TEXTCB report{};
    report.msg_time = p.msg_time;
    m.text.text.copy(report.message, sizeof report.message - 1);
    report.type = static_cast<vrpn_TEXT_SEVERITY>(std::min(m.severity, 2U));
    report.level = m.level;
    static_cast<vrpn_Text_Receiver*>(self)->messages_.call_handlers(report);
  });
}

int vrpn_Text_Sender::send_message(const char* text, vrpn_TEXT_SEVERITY severity, vrpn_uint32 level,
                                   const timeval time) {
  timeval stamp = time;
  if (stamp.tv_sec == 0 && stamp.tv_usec == 0) vrpn_gettimeofday(&stamp);
  return send_text_message(text, stamp, severity, level);
}
