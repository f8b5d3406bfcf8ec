// A connection to a server, shared by all devices of that server.
#ifndef VRPN_CONNECTION_H
#define VRPN_CONNECTION_H

#include <stdio.h>

#include <memory>
#include <string>
#include <vector>

#include "vrpn_Configure.h"
#include "vrpn_Shared.h"
#include "vrpn_Types.h"

namespace hapticd::client {
class Link;
struct Arrival;
}  // namespace hapticd::client

struct vrpn_HANDLERPARAM {
  vrpn_int32 type;
  vrpn_int32 sender;
  struct timeval msg_time;
  vrpn_int32 payload_len;
  const char* buffer;
};
typedef int(VRPN_CALLBACK* vrpn_MESSAGEHANDLER)(void* userdata, vrpn_HANDLERPARAM p);

const vrpn_int32 vrpn_ANY_SENDER = -1;
const vrpn_int32 vrpn_ANY_TYPE = -1;
const int vrpn_CONNECTION_TCP_BUFLEN = 64000;
const int vrpn_CONNECTION_UDP_BUFLEN = 1472;
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

  void addReference();
  void removeReference();
  /// Whether the connection is deleted with its last reference.
  void setAutoDeleteStatus(bool value) { autoDelete_ = value; }

  // Not in VRPN: for the remote devices of this library.
  hapticd::client::Link* link() { return link_.get(); }
  vrpn_int32 registerDevice(const char* name);
  /// Whether anything arrived from this sender on the present connection.
  bool heard(vrpn_int32 sender) const;

 private:
  struct Handler {
    vrpn_int32 type;
    vrpn_int32 sender;
    vrpn_MESSAGEHANDLER function;  // NULL: unregistered while handlers are called
    void* userdata;
  };
  void dispatch(const hapticd::client::Arrival& arrival);
  void callHandlers(const vrpn_HANDLERPARAM& p);
  void callControlHandlers(const char* type);

  std::string name_;
  std::unique_ptr<hapticd::client::Link> link_;
  std::vector<Handler> handlers_;
  struct timeval opened_;
  int references_ = 0;
  int calling_ = 0;
  bool autoDelete_ = false;
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

#endif
