// A connection to a server, shared by all devices of that server.
#ifndef VRPN_CONNECTION_H
#define VRPN_CONNECTION_H

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "vrpn_Configure.h"
#include "vrpn_Shared.h"
#include "vrpn_Types.h"

namespace hapticd {
namespace client {
class Link;
class ServerLink;
struct Arrival;
}  // namespace client
namespace wire {
class LocalNames;
}  // namespace wire
}  // namespace hapticd

struct vrpn_HANDLERPARAM {
  vrpn_int32 type;
  vrpn_int32 sender;
  struct timeval msg_time;
  vrpn_int32 payload_len;
  const char* buffer;
};
typedef int(VRPN_CALLBACK* vrpn_MESSAGEHANDLER)(void* userdata, vrpn_HANDLERPARAM p);

/// Decides whether a message is logged; this library writes no logs.
typedef int(VRPN_CALLBACK* vrpn_LOGFILTER)(void* userdata, vrpn_HANDLERPARAM p);

const vrpn_int32 vrpn_ANY_SENDER = -1;
const vrpn_int32 vrpn_ANY_TYPE = -1;
const int vrpn_CONNECTION_TCP_BUFLEN = 64000;
const int vrpn_CONNECTION_UDP_BUFLEN = 1472;
const int vrpn_CONNECTION_MAX_SENDERS = 2000;
const int vrpn_CONNECTION_MAX_TYPES = 2000;
const int vrpn_MAX_ENDPOINTS = 256;
const unsigned vrpn_ALIGN = 8;
const vrpn_int32 vrpn_CONNECTION_SENDER_DESCRIPTION = -1;
const vrpn_int32 vrpn_CONNECTION_TYPE_DESCRIPTION = -2;
const vrpn_int32 vrpn_CONNECTION_UDP_DESCRIPTION = -3;
const vrpn_int32 vrpn_CONNECTION_LOG_DESCRIPTION = -4;
const vrpn_int32 vrpn_CONNECTION_DISCONNECT_MESSAGE = -5;
const long vrpn_LOG_NONE = 0;
const long vrpn_LOG_INCOMING = 1 << 0;
const long vrpn_LOG_OUTGOING = 1 << 1;
const unsigned vrpn_CNAME_LENGTH = 100;
typedef char vrpn_CNAME[vrpn_CNAME_LENGTH];

const vrpn_uint32 vrpn_CONNECTION_RELIABLE = 1 << 0;
const vrpn_uint32 vrpn_CONNECTION_FIXED_LATENCY = 1 << 1;
const vrpn_uint32 vrpn_CONNECTION_LOW_LATENCY = 1 << 2;
const vrpn_uint32 vrpn_CONNECTION_FIXED_THROUGHPUT = 1 << 3;
const vrpn_uint32 vrpn_CONNECTION_HIGH_THROUGHPUT = 1 << 4;

extern VRPN_API const char* vrpn_got_first_connection;
extern VRPN_API const char* vrpn_got_connection;
extern VRPN_API const char* vrpn_dropped_connection;
extern VRPN_API const char* vrpn_dropped_last_connection;
extern VRPN_API const char* vrpn_CONTROL;

class vrpn_File_Connection;
class vrpn_TranslationTable;  // VRPN's own, never used here

/// Thread: that of the caller, always the same one. Several threads may have a connection each: to different
/// servers, or opened with force_reopen.
class VRPN_API vrpn_Connection {
 public:
  /// Opens a server: host, host:port or tcp://host:port. Prints an error and stays unconnected when that
  /// fails.
  explicit vrpn_Connection(const char* server);
  virtual ~vrpn_Connection();
  vrpn_Connection(const vrpn_Connection&) = delete;
  vrpn_Connection& operator=(const vrpn_Connection&) = delete;

  /// Whether there is a connection, or attempts to connect continue.
  virtual vrpn_bool doing_okay() const;
  virtual vrpn_bool connected() const;
  /// Sends, receives and calls handlers; sleeps up to the timeout until something arrives, or not at all.
  virtual int mainloop(const struct timeval* timeout = NULL);

  virtual vrpn_int32 register_sender(const char* name);
  virtual vrpn_int32 register_message_type(const char* name);
  virtual int register_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                               vrpn_int32 sender = vrpn_ANY_SENDER);
  virtual int unregister_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                 vrpn_int32 sender = vrpn_ANY_SENDER);
  virtual int pack_message(vrpn_uint32 len, struct timeval time, vrpn_int32 type, vrpn_int32 sender,
                           const char* buffer, vrpn_uint32 class_of_service);
  virtual int send_pending_reports();
  virtual int time_since_connection_open(struct timeval* elapsed);
  virtual struct timeval get_time();
  /// NULL for an unknown number.
  virtual const char* sender_name(vrpn_int32 sender);
  virtual const char* message_type_name(vrpn_int32 type);

  /// This library reads and writes no logs and limits no messages, so these do nothing.
  void Jane_stop_this_crazy_thing(vrpn_uint32) {}
  virtual vrpn_File_Connection* get_File_Connection() { return NULL; }
  int register_log_filter(vrpn_LOGFILTER, void*) { return 0; }
  int save_log_so_far() { return 0; }

  void addReference();
  void removeReference();
  /// Whether the connection is deleted with its last reference.
  void setAutoDeleteStatus(bool value) { autoDelete_ = value; }

  // Not in VRPN: for the devices of this library.
  hapticd::client::Link* link() { return link_.get(); }
  /// Serves at this address (NULL: every one of this machine); port 0 lets the system choose one, a negative
  /// one serves this program only. Prints an error, and doing_okay() is false, when the port is taken.
  vrpn_Connection(const char* address, int port);
  /// The port that is served; 0 for the connection of a client.
  int servedPort() const;
  vrpn_int32 registerDevice(const char* name);
  /// Whether anything arrived from this sender on the present connection.
  bool heard(vrpn_int32 sender) const;
  /// Prints why a message was not sent; what did not fit before the first connection, only once.
  void printRefusal(const std::exception& error);

 protected:
  /// Calls the handlers of a message.
  void callHandlers(const vrpn_HANDLERPARAM& p);

 private:
  struct Handler {
    vrpn_int32 type;
    vrpn_int32 sender;
    vrpn_MESSAGEHANDLER function;  // NULL: unregistered while handlers are called
    void* userdata;
  };
  struct Call;
  const hapticd::wire::LocalNames* names() const;
  void dispatch(const hapticd::client::Arrival& arrival);
  void callControlHandlers(const char* type);
  bool isUnused() const;
  void close();

  std::string name_;
  std::unique_ptr<hapticd::client::Link> link_;          // of a client, or
  std::unique_ptr<hapticd::client::ServerLink> served_;  // of a server
  int clients_ = 0;  // whose connection was reported to handlers; a client counts its server
  std::vector<Handler> handlers_;
  struct timeval opened_;
  int references_ = 0;
  int calling_ = 0;
  bool autoDelete_ = false;
  bool refusalPrinted_ = false;
};

/// A connection that serves the devices of this program: on a port of this machine, or at [address][:port];
/// "loopback:" serves this program only. NULL, with an error on stderr, when the port is taken. The caller
/// holds a reference. This library writes no log files.
VRPN_API vrpn_Connection* vrpn_create_server_connection(int port = vrpn_DEFAULT_LISTEN_PORT_NO,
                                                        const char* local_in_logfile = NULL,
                                                        const char* local_out_logfile = NULL,
                                                        const char* NIC_address = NULL);
VRPN_API vrpn_Connection* vrpn_create_server_connection(const char* name, const char* local_in_logfile = NULL,
                                                        const char* local_out_logfile = NULL);

/// For programs that create the connection that serves their devices themselves; the functions here return
/// any vrpn_Connection. doing_okay() is false when the port is taken.
class VRPN_API vrpn_Connection_IP : public vrpn_Connection {
 public:
  vrpn_Connection_IP(unsigned short port = vrpn_DEFAULT_LISTEN_PORT_NO, const char* local_in_logfile = NULL,
                     const char* local_out_logfile = NULL, const char* NIC_address = NULL);
};
/// VRPN's name for a connection within one program.
typedef vrpn_Connection vrpn_Connection_Loopback;

/// The connections of this program.
class VRPN_API vrpn_ConnectionManager {
 public:
  static vrpn_ConnectionManager& instance();
  /// The connection to a server by the name that opened it, without NAME@; NULL when there is none. Does not
  /// open one and adds no reference.
  vrpn_Connection* getByName(const char* name);

 private:
  vrpn_ConnectionManager() {}
};

/// The connection to a server (the part of the name behind the last @), opened unless it is open. This
/// library writes no log files.
VRPN_API vrpn_Connection* vrpn_get_connection_by_name(const char* name, const char* local_in_logfile = NULL,
                                                      const char* local_out_logfile = NULL,
                                                      const char* remote_in_logfile = NULL,
                                                      const char* remote_out_logfile = NULL,
                                                      const char* NIC_address = NULL,
                                                      bool force_reopen = false);

/// The part before, or behind, the @; the caller releases it by delete[].
VRPN_API char* vrpn_copy_service_name(const char* name);
VRPN_API char* vrpn_copy_service_location(const char* name);

/// The host of a name such as NAME@tcp://host:port; the caller releases it by delete[].
inline char* vrpn_copy_machine_name(const char* name) {
  const char* at = strrchr(name, '@');
  std::string host(at != NULL ? at + 1 : name);
  const size_t scheme = host.find("//");
  if (scheme != std::string::npos) {
    host.erase(0, scheme + 2);
  } else if (host.compare(0, 4, "tcp:") == 0) {
    host.erase(0, 4);
  } else if (host.compare(0, 7, "x-vrpn:") == 0) {
    host.erase(0, 7);
  }
  const size_t end = host.find_first_of(":/");
  if (end != std::string::npos) host.erase(end);
  char* copy = new char[host.size() + 1];
  memcpy(copy, host.c_str(), host.size() + 1);
  return copy;
}
/// The port behind the last colon; VRPN's own when there is none.
inline int vrpn_get_port_number(const char* name) {
  const char* colon = strrchr(name, ':');
  const int port = colon != NULL ? atoi(colon + 1) : 0;
  return port > 0 ? port : vrpn_DEFAULT_LISTEN_PORT_NO;
}
/// The path in NAME@file:path or file://path, NULL for other names; the caller releases it by delete[].
inline char* vrpn_copy_file_name(const char* name) {
  const char* at = strchr(name, '@');
  const char* path = at != NULL ? at + 1 : name;
  if (strncmp(path, "file:", 5) != 0) return NULL;
  path += strncmp(path, "file://", 7) == 0 ? 7 : 5;
  char* copy = new char[strlen(path) + 1];
  memcpy(copy, path, strlen(path) + 1);
  return copy;
}
/// NAME@server with another NAME; the caller releases it by delete[].
inline char* vrpn_set_service_name(const char* name, const char* service) {
  const char* at = strrchr(name, '@');
  const std::string text = std::string(service) + "@" + (at != NULL ? at + 1 : name);
  char* copy = new char[text.size() + 1];
  memcpy(copy, text.c_str(), text.size() + 1);
  return copy;
}

/// The greeting of both sides: VRPN's version and the log mode in 24 bytes.
inline size_t vrpn_cookie_size() {
  return 24;
}
/// -1 when the buffer is too short.
inline int write_vrpn_cookie(char* buffer, size_t length, long remote_log_mode) {
  if (length < vrpn_cookie_size() + 1) return -1;
  memset(buffer, 0, vrpn_cookie_size() + 1);
  snprintf(buffer, length, "vrpn: ver. 07.38  %c", static_cast<char>('0' + (remote_log_mode & 3)));
  return 0;
}
/// 0 for the same version, 1 for another minor one, -1 for a peer that speaks something else.
inline int check_vrpn_cookie(const char* buffer) {
  const char* const ours = "vrpn: ver. 07.38";
  if (strncmp(buffer, ours, strlen(ours) - 2) != 0) return -1;
  return strncmp(buffer, ours, strlen(ours)) == 0 ? 0 : 1;
}

/// write() and read() of all bytes, repeated after interruptions; the number of bytes, or -1.
inline int vrpn_noint_block_write(int descriptor, const char* buffer, size_t length) {
  size_t done = 0;
  while (done < length) {
    const ssize_t count = write(descriptor, buffer + done, length - done);
    if (count < 0 && errno != EINTR) return -1;
    if (count == 0) break;
    if (count > 0) done += static_cast<size_t>(count);
  }
  return static_cast<int>(done);
}
inline int vrpn_noint_block_read(int descriptor, char* buffer, size_t length) {
  size_t done = 0;
  while (done < length) {
    const ssize_t count = read(descriptor, buffer + done, length - done);
    if (count < 0 && errno != EINTR) return -1;
    if (count == 0) break;
    if (count > 0) done += static_cast<size_t>(count);
  }
  return static_cast<int>(done);
}

#endif
