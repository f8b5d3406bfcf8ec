#include "hapticd/vrpn/vrpn_Connection.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "base/world.h"
#include "client/vrpn/messages.h"
#include "client/vrpn/server_link.h"
#include "hapticd/error.h"
#include "hapticd/vrpn/vrpn_FileConnection.h"

using hapticd::client::Arrival;
using hapticd::client::Link;
using hapticd::client::ServerLink;

const char* vrpn_got_first_connection = "VRPN_Connection_Got_First_Connection";
const char* vrpn_got_connection = "VRPN_Connection_Got_Connection";
const char* vrpn_dropped_connection = "VRPN_Connection_Dropped_Connection";
const char* vrpn_dropped_last_connection = "VRPN_Connection_Dropped_Last_Connection";
const char* vrpn_CONTROL = "VRPN Control";

namespace {

// These types are never sent. Their numbers are the last ones that programs expect, and no other type has
// them.
constexpr vrpn_int32 kFirstControlType = vrpn_CONNECTION_MAX_TYPES - 4;

const std::array<const char*, 4>& controlTypes() {
  static const std::array<const char*, 4> types{vrpn_got_first_connection, vrpn_got_connection,
                                                vrpn_dropped_connection, vrpn_dropped_last_connection};
  return types;
}

// The open connections by the names of their servers. Each belongs to one thread, the table to all.
class KnownConnections {
 public:
  vrpn_Connection* find(const std::string& server) const {
    const std::lock_guard lock(mutex_);
    const auto found = open_.find(server);
    return found == open_.end() ? nullptr : found->second;
  }
  void add(const std::string& server, vrpn_Connection* connection) {
    const std::lock_guard lock(mutex_);
    open_[server] = connection;
  }
  void forget(const vrpn_Connection* connection) {
    const std::lock_guard lock(mutex_);
    std::erase_if(open_, [connection](const auto& known) { return known.second == connection; });
  }
  /// For connections that are closed and never deleted, so that a checker of leaks finds them.
  void keep(const vrpn_Connection* connection) {
    const std::lock_guard lock(mutex_);
    closed_.push_back(connection);
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, vrpn_Connection*> open_;
  std::vector<const vrpn_Connection*> closed_;
};

// Never destroyed: a device may be in a variable that is destroyed later.
KnownConnections& knownConnections() {
  static auto& connections = *new KnownConnections;
  return connections;
}

void refuseLogs(std::initializer_list<const char*> files) {
  for (const char* file : files) {
    if (file && *file) fprintf(stderr, "VRPN: log file %s is not written by this library\n", file);
  }
}

char* copyOf(std::string_view text) {
  char* copy = new char[text.size() + 1];
  std::copy(text.begin(), text.end(), copy);
  copy[text.size()] = '\0';
  return copy;
}

}  // namespace

vrpn_Connection::vrpn_Connection(const char* server) : name_(server), opened_(get_time()) {
  try {
    // Programs written for VRPN expect that a device ends at once.
    link_ = std::make_unique<Link>(
        hapticd::client::parseServer(server),
        hapticd::client::LinkOptions{.endSendTimeout = Link::kEndTimeout, .adoptNames = true});
    link_->addSender(vrpn_CONTROL);
    link_->waitConnected(std::chrono::seconds(1));  // as stock VRPN; the link keeps trying afterwards
  } catch (const std::exception& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
  }
}

vrpn_Connection::vrpn_Connection(const char* address, int port) : opened_(get_time()) {
  try {
    std::optional<hapticd::net::Endpoint> local;
    if (port >= 0) {
      local.emplace();
      if (address != nullptr && *address != '\0') local->address = hapticd::net::resolve(address);
      local->port = static_cast<std::uint16_t>(port);
    }
    served_ = std::make_unique<ServerLink>(local);
    served_->addSender(vrpn_CONTROL);
  } catch (const std::exception& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
  }
}

vrpn_Connection_IP::vrpn_Connection_IP(unsigned short port, const char* local_in_logfile,
                                       const char* local_out_logfile, const char* NIC_address)
    : vrpn_Connection(NIC_address, port) {
  refuseLogs({local_in_logfile, local_out_logfile});
}

int vrpn_Connection::servedPort() const {
  return served_ ? served_->port() : 0;
}

vrpn_Connection::~vrpn_Connection() {
  knownConnections().forget(this);
}

vrpn_bool vrpn_Connection::doing_okay() const {
  return link_ || served_;
}
vrpn_bool vrpn_Connection::connected() const {
  // A loopback has no clients: this program is connected to itself.
  return served_ ? clients_ > 0 || servedPort() == 0 : link_ && link_->connected();
}
// The devices of a server are in this program.
bool vrpn_Connection::heard(vrpn_int32 sender) const {
  return served_ || (sender >= 0 && link_ && link_->heard({sender}));
}

// While handlers may run. When the outermost one has returned or thrown, those that were unregistered are
// removed, and the connection is closed if they deleted its last device.
struct vrpn_Connection::Call {
  explicit Call(vrpn_Connection& connection) : of(connection) { ++of.calling_; }
  ~Call() {
    if (--of.calling_ > 0) return;
    std::erase_if(of.handlers_, [](const Handler& h) { return !h.function; });
    if (of.isUnused()) of.close();
  }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;
  vrpn_Connection& of;
};

int vrpn_Connection::mainloop(const timeval* timeout) {
  if (!doing_okay()) return -1;
  const Call call(*this);
  const auto wait = timeout
                        ? std::chrono::seconds(timeout->tv_sec) + std::chrono::microseconds(timeout->tv_usec)
                        : std::chrono::microseconds(0);
  try {
    const auto handler = [this](const Arrival& arrival) { dispatch(arrival); };
    if (served_) {
      served_->poll(wait, handler);
    } else {
      link_->poll(wait, handler);
    }
  } catch (const hapticd::Error& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
    return -1;
  }
  return 0;
}

void vrpn_Connection::dispatch(const Arrival& arrival) {
  if (arrival.what == Arrival::What::connected) {
    if (clients_++ == 0) callControlHandlers(vrpn_got_first_connection);
    callControlHandlers(vrpn_got_connection);
  } else if (arrival.what == Arrival::What::lost) {
    callControlHandlers(vrpn_dropped_connection);
    if (--clients_ == 0) callControlHandlers(vrpn_dropped_last_connection);
  } else if (arrival.type.value >= 0 && arrival.type.value < kFirstControlType && arrival.sender.value >= 0) {
    callHandlers(
        {arrival.type.value,
         arrival.sender.value,
         {static_cast<time_t>(arrival.time.seconds), static_cast<suseconds_t>(arrival.time.microseconds)},
         static_cast<vrpn_int32>(arrival.bytes.size()),
         reinterpret_cast<const char*>(arrival.bytes.data())});
  }
}

void vrpn_Connection::callControlHandlers(const char* type) {
  callHandlers({register_message_type(type), register_sender(vrpn_CONTROL), get_time(), 0, nullptr});
}

void vrpn_Connection::callHandlers(const vrpn_HANDLERPARAM& p) {
  const Call call(*this);
  for (const vrpn_int32 type : {vrpn_ANY_TYPE, p.type}) {  // VRPN's order
    for (std::size_t i = 0; i < handlers_.size(); ++i) {
      const Handler h = handlers_[i];  // a copy: handlers may register others
      const bool wanted =
          h.function && h.type == type && (h.sender == p.sender || h.sender == vrpn_ANY_SENDER);
      if (wanted) h.function(h.userdata, p);
    }
  }
}

vrpn_int32 vrpn_Connection::register_sender(const char* name) {
  try {
    return served_ ? served_->addSender(name).value : link_ ? link_->addSender(name).value : -1;
  } catch (const std::logic_error& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
    return -1;
  }
}

vrpn_int32 vrpn_Connection::registerDevice(const char* name) {
  const vrpn_int32 sender = register_sender(name);
  return sender < 0 || served_ ? sender : link_->addDevice(name).value;
}

vrpn_int32 vrpn_Connection::register_message_type(const char* name) {
  for (std::size_t i = 0; i < controlTypes().size(); ++i) {
    if (std::strcmp(name, controlTypes()[i]) == 0) return kFirstControlType + static_cast<vrpn_int32>(i);
  }
  try {
    const vrpn_int32 type = served_ ? served_->addType(name).value : link_ ? link_->addType(name).value : -1;
    if (type >= kFirstControlType) throw std::length_error("too many types of messages");
    return type;
  } catch (const std::logic_error& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
    return -1;
  }
}

int vrpn_Connection::register_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                      vrpn_int32 sender) {
  if (!handler || type < vrpn_ANY_TYPE || sender < vrpn_ANY_SENDER) return -1;
  handlers_.push_back({type, sender, handler, userdata});
  return 0;
}

int vrpn_Connection::unregister_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                        vrpn_int32 sender) {
  const auto found = std::find_if(handlers_.begin(), handlers_.end(), [&](const Handler& h) {
    return h.type == type && h.sender == sender && h.function == handler && h.userdata == userdata;
  });
  if (found == handlers_.end()) return -1;
  if (calling_ > 0) {
    found->function = nullptr;
  } else {
    handlers_.erase(found);
  }
  return 0;
}

int vrpn_Connection::pack_message(vrpn_uint32 len, timeval time, vrpn_int32 type, vrpn_int32 sender,
                                  const char* buffer, vrpn_uint32 class_of_service) {
  if (!message_type_name(type) || !sender_name(sender)) return -1;
  if (type >= kFirstControlType) {
    callHandlers({type, sender, time, static_cast<vrpn_int32>(len), buffer});
    return 0;
  }
  using hapticd::wire::Reliability;
  const bool reliable = (class_of_service & vrpn_CONNECTION_RELIABLE) != 0;
  const hapticd::wire::Time stamp{static_cast<std::uint32_t>(time.tv_sec),
                                  static_cast<std::uint32_t>(time.tv_usec)};
  const hapticd::wire::ByteView payload(reinterpret_cast<const std::byte*>(buffer), len);
  const Reliability reliability = reliable ? Reliability::kReliable : Reliability::kLowLatency;
  try {
    if (served_) {
      served_->send(stamp, {sender}, {type}, payload, reliability);
    } else {
      link_->sendRaw(stamp, {sender}, {type}, payload, reliability);
    }
  } catch (const std::exception& error) {
    printRefusal(error);
    return -1;
  }
  // Handlers and devices in the program itself hear it, too.
  callHandlers({type, sender, time, static_cast<vrpn_int32>(len), buffer});
  return 0;
}

void vrpn_Connection::printRefusal(const std::exception& error) {
  const bool unconnected = dynamic_cast<const hapticd::ConnectError*>(&error) != nullptr;
  if (unconnected && std::exchange(refusalPrinted_, true)) return;
  fprintf(stderr, "VRPN: %s\n", error.what());
}

int vrpn_Connection::send_pending_reports() {
  if (!doing_okay()) return -1;
  if (served_) {
    served_->flush();
  } else {
    link_->flush();
  }
  return 0;
}

int vrpn_Connection::time_since_connection_open(timeval* elapsed) {
  *elapsed = vrpn_TimevalDiff(get_time(), opened_);
  return 0;
}

timeval vrpn_Connection::get_time() {
  const hapticd::base::Nanos us = hapticd::base::wallNow() / 1000;
  return {static_cast<time_t>(us / 1'000'000), static_cast<suseconds_t>(us % 1'000'000)};
}

const hapticd::wire::LocalNames* vrpn_Connection::names() const {
  return served_ ? &served_->names() : link_ ? &link_->names() : nullptr;
}

const char* vrpn_Connection::sender_name(vrpn_int32 sender) {
  if (!names() || sender < 0 || static_cast<std::size_t>(sender) >= names()->senders().size()) return nullptr;
  return names()->senders()[static_cast<std::size_t>(sender)].c_str();
}

const char* vrpn_Connection::message_type_name(vrpn_int32 type) {
  if (type >= kFirstControlType) {
    const auto index = static_cast<std::size_t>(type - kFirstControlType);
    return index < controlTypes().size() ? controlTypes()[index] : nullptr;
  }
  if (!names() || type < 0 || static_cast<std::size_t>(type) >= names()->types().size()) return nullptr;
  return names()->types()[static_cast<std::size_t>(type)].c_str();
}

void vrpn_Connection::addReference() {
  ++references_;
}

void vrpn_Connection::removeReference() {
  --references_;
  if (calling_ == 0 && isUnused()) delete this;
}

bool vrpn_Connection::isUnused() const {
  return references_ <= 0 && autoDelete_;
}

// The last device was deleted by a handler, which returned into the connection and perhaps into that device:
// the forces of this client end, and the rest of the connection stays.
void vrpn_Connection::close() {
  if (!link_ && !served_) return;  // closed already
  knownConnections().keep(this);
  knownConnections().forget(this);
  link_.reset();
  served_.reset();
}

vrpn_Connection* vrpn_get_connection_by_name(const char* name, const char* local_in_logfile,
                                             const char* local_out_logfile, const char* remote_in_logfile,
                                             const char* remote_out_logfile, const char*, bool force_reopen) {
  if (!name) return nullptr;
  refuseLogs({local_in_logfile, local_out_logfile, remote_in_logfile, remote_out_logfile});
  const char* at = std::strrchr(name, '@');
  const std::string server = at ? at + 1 : name;
  vrpn_Connection* connection = force_reopen ? nullptr : knownConnections().find(server);
  if (!connection) {
    const std::unique_ptr<char[]> file(vrpn_copy_file_name(name));
    connection = file ? new vrpn_File_Connection(name) : new vrpn_Connection(server.c_str());
    connection->setAutoDeleteStatus(true);
    knownConnections().add(server, connection);
  }
  connection->addReference();
  return connection;
}

vrpn_Connection* vrpn_create_server_connection(int port, const char* local_in_logfile,
                                               const char* local_out_logfile, const char* NIC_address) {
  refuseLogs({local_in_logfile, local_out_logfile});
  auto connection = std::make_unique<vrpn_Connection>(NIC_address, port);
  if (!connection->doing_okay()) return nullptr;
  connection->setAutoDeleteStatus(true);
  connection->addReference();
  return connection.release();
}

vrpn_Connection* vrpn_create_server_connection(const char* name, const char* local_in_logfile,
                                               const char* local_out_logfile) {
  if (!name) return nullptr;
  const char* at = std::strrchr(name, '@');
  const char* location = at ? at + 1 : name;
  if (std::strncmp(location, "loopback:", std::strlen("loopback:")) == 0) {
    return vrpn_create_server_connection(-1, local_in_logfile, local_out_logfile, nullptr);
  }
  const std::unique_ptr<char[]> address(vrpn_copy_machine_name(location));
  return vrpn_create_server_connection(vrpn_get_port_number(location), local_in_logfile, local_out_logfile,
                                       address.get());
}

vrpn_ConnectionManager& vrpn_ConnectionManager::instance() {
  static vrpn_ConnectionManager manager;
  return manager;
}

vrpn_Connection* vrpn_ConnectionManager::getByName(const char* name) {
  return knownConnections().find(name);
}

char* vrpn_copy_service_name(const char* name) {
  return copyOf(std::string_view(name).substr(0, std::string_view(name).find('@')));
}

char* vrpn_copy_service_location(const char* name) {
  const std::string_view text(name);
  const std::size_t at = text.find('@');
  return copyOf(at == std::string_view::npos ? text : text.substr(at + 1));
}
