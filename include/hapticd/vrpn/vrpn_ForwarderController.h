// A client asks a server to forward messages to another port.
#ifndef VRPN_FORWARDER_CONTROLLER_H
#define VRPN_FORWARDER_CONTROLLER_H

#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include "vrpn_Connection.h"
#include "vrpn_Forwarder.h"

/// What both ends share.
class vrpn_Forwarder_Brain {
 public:
  explicit vrpn_Forwarder_Brain(vrpn_Connection* connection) : d_connection(connection) {
    if (d_connection == NULL) return;
    d_connection->addReference();
    d_myId = d_connection->register_sender("vrpn_Forwarder_Brain");
    d_start_forwarding_type = d_connection->register_message_type("vrpn_Forwarder_Brain start_forwarding");
    d_forward_type = d_connection->register_message_type("vrpn_Forwarder_Brain forward");
  }
  virtual ~vrpn_Forwarder_Brain() {
    if (d_connection != NULL) d_connection->removeReference();
  }
  vrpn_Forwarder_Brain(const vrpn_Forwarder_Brain&) = delete;
  vrpn_Forwarder_Brain& operator=(const vrpn_Forwarder_Brain&) = delete;

  /// The server opens this port.
  virtual vrpn_bool start_remote_forwarding(vrpn_int32 port) = 0;
  /// The server forwards these messages of this device to the port.
  virtual void forward_message_type(vrpn_int32 port, const char* service_name, const char* message_type) = 0;

 protected:
  vrpn_Connection* d_connection;
  vrpn_int32 d_myId = -1;
  vrpn_int32 d_start_forwarding_type = -1;
  vrpn_int32 d_forward_type = -1;
};

/// The server's end: opens ports for whoever is connected, so construct it only where all clients are
/// trusted.
class vrpn_Forwarder_Server : public vrpn_Forwarder_Brain {
 public:
  explicit vrpn_Forwarder_Server(vrpn_Connection* connection) : vrpn_Forwarder_Brain(connection) {
    if (d_connection == NULL) return;
    d_connection->register_handler(d_start_forwarding_type, onStart, this, d_myId);
    d_connection->register_handler(d_forward_type, onForward, this, d_myId);
  }
  virtual ~vrpn_Forwarder_Server() {
    if (d_connection == NULL) return;
    d_connection->unregister_handler(d_start_forwarding_type, onStart, this, d_myId);
    d_connection->unregister_handler(d_forward_type, onForward, this, d_myId);
  }

  /// Serves the opened ports.
  virtual void mainloop() {
    for (std::map<vrpn_int32, Port>::iterator port = ports_.begin(); port != ports_.end(); ++port) {
      port->second.connection->mainloop();
    }
  }
  /// False, with an error on stderr, when the port is taken.
  virtual vrpn_bool start_remote_forwarding(vrpn_int32 port) {
    if (ports_.count(port) != 0) {
      fprintf(stderr, "VRPN: already forwarding to port %d\n", port);
      return false;
    }
    Port opened;
    opened.connection.reset(vrpn_create_server_connection(port));
    if (!opened.connection) return false;
    opened.forwarder.reset(new vrpn_ConnectionForwarder(d_connection, opened.connection.get()));
    ports_[port] = std::move(opened);
    return true;
  }
  virtual void forward_message_type(vrpn_int32 port, const char* service_name, const char* message_type) {
    const std::map<vrpn_int32, Port>::iterator opened = ports_.find(port);
    if (opened == ports_.end()) {
      fprintf(stderr, "VRPN: cannot forward %s to port %d: start_remote_forwarding() opens it\n",
              message_type, port);
      return;
    }
    opened->second.forwarder->forward(message_type, service_name, message_type, service_name);
  }
  /// Not in VRPN: the connection at this port; NULL when it was not opened.
  vrpn_Connection* connectionAt(vrpn_int32 port) const {
    const std::map<vrpn_int32, Port>::const_iterator opened = ports_.find(port);
    return opened == ports_.end() ? NULL : opened->second.connection.get();
  }

 private:
  struct Release {
    void operator()(vrpn_Connection* connection) const { connection->removeReference(); }
  };
  // The forwarder ends before its connection.
  struct Port {
    std::unique_ptr<vrpn_Connection, Release> connection;
    std::unique_ptr<vrpn_ConnectionForwarder> forwarder;
  };

  static int VRPN_CALLBACK onStart(void* self, vrpn_HANDLERPARAM p) {
    if (p.payload_len < 4) return 0;
    static_cast<vrpn_Forwarder_Server*>(self)->start_remote_forwarding(vrpn_unbuffer<vrpn_int32>(p.buffer));
    return 0;
  }
  // Port, lengths of both names, both names. Lengths that do not fit are ignored.
  static int VRPN_CALLBACK onForward(void* self, vrpn_HANDLERPARAM p) {
    if (p.payload_len < 12) return 0;
    const vrpn_int32 port = vrpn_unbuffer<vrpn_int32>(p.buffer);
    const vrpn_int32 service = vrpn_unbuffer<vrpn_int32>(p.buffer);
    const vrpn_int32 type = vrpn_unbuffer<vrpn_int32>(p.buffer);
    const vrpn_int32 left = p.payload_len - 12;
    if (service < 0 || type < 0 || service > left || type > left - service) return 0;
    const std::string serviceName(p.buffer, static_cast<size_t>(service));
    const std::string typeName(p.buffer + service, static_cast<size_t>(type));
    static_cast<vrpn_Forwarder_Server*>(self)->forward_message_type(port, serviceName.c_str(),
                                                                    typeName.c_str());
    return 0;
  }

  std::map<vrpn_int32, Port> ports_;
};

/// The client's end, for a vrpn_Forwarder_Server at the other end of the connection.
class vrpn_Forwarder_Controller : public vrpn_Forwarder_Brain {
 public:
  explicit vrpn_Forwarder_Controller(vrpn_Connection* connection) : vrpn_Forwarder_Brain(connection) {}

  /// Whether the request could be sent; the server does not answer it.
  virtual vrpn_bool start_remote_forwarding(vrpn_int32 port) {
    char payload[4];
    char* at = payload;
    vrpn_int32 left = sizeof(payload);
    vrpn_buffer(&at, &left, port);
    return send(d_start_forwarding_type, payload, sizeof(payload));
  }
  virtual void forward_message_type(vrpn_int32 port, const char* service_name, const char* message_type) {
    char numbers[12];
    char* at = numbers;
    vrpn_int32 left = sizeof(numbers);
    vrpn_buffer(&at, &left, port);
    vrpn_buffer(&at, &left, static_cast<vrpn_int32>(strlen(service_name)));
    vrpn_buffer(&at, &left, static_cast<vrpn_int32>(strlen(message_type)));
    const std::string payload = std::string(numbers, sizeof(numbers)) + service_name + message_type;
    send(d_forward_type, payload.data(), payload.size());
  }

 private:
  vrpn_bool send(vrpn_int32 type, const char* payload, size_t length) {
    if (d_connection == NULL) return false;
    struct timeval now;
    vrpn_gettimeofday(&now, NULL);
    return d_connection->pack_message(static_cast<vrpn_uint32>(length), now, type, d_myId, payload,
                                      vrpn_CONNECTION_RELIABLE) == 0;
  }
};

#endif
