// A lock that one program serves and the others share. The program runs the connection.
#ifndef VRPN_MUTEX_H
#define VRPN_MUTEX_H

#include <unistd.h>

#include <memory>
#include <utility>
#include <vector>

#include "vrpn_Connection.h"
#include "vrpn_Shared.h"

/// What server and clients have in common: name, connection and messages.
class vrpn_Mutex {
 public:
  vrpn_Mutex(const char* name, vrpn_Connection* connection = NULL) {
    if (connection != NULL) {
      d_connection = connection;
      d_connection->addReference();
    } else {
      d_connection = vrpn_get_connection_by_name(name);
    }
    if (d_connection == NULL) return;
    const std::unique_ptr<char[]> service(vrpn_copy_service_name(name));
    d_myId = d_connection->register_sender(service.get());
    d_requestIndex_type = d_connection->register_message_type("vrpn_Mutex Request Index");
    d_requestMutex_type = d_connection->register_message_type("vrpn_Mutex Request Mutex");
    d_release_type = d_connection->register_message_type("vrpn_Mutex Release");
    d_releaseNotification_type = d_connection->register_message_type("vrpn_Mutex Release_Notification");
    d_grantRequest_type = d_connection->register_message_type("vrpn_Mutex Grant_Request");
    d_denyRequest_type = d_connection->register_message_type("vrpn_Mutex Deny_Request");
    d_initialize_type = d_connection->register_message_type("vrpn_Mutex Initialize");
  }
  virtual ~vrpn_Mutex() {
    if (d_connection == NULL) return;
    for (size_t i = 0; i < handlers_.size(); ++i)
      d_connection->unregister_handler(handlers_[i].type, handlers_[i].function, handlers_[i].self,
                                       handlers_[i].sender);
    d_connection->removeReference();
  }
  vrpn_Mutex(const vrpn_Mutex&) = delete;
  vrpn_Mutex& operator=(const vrpn_Mutex&) = delete;

  void mainloop() {
    if (d_connection != NULL) d_connection->mainloop();
  }

 protected:
  void on(vrpn_int32 type, vrpn_MESSAGEHANDLER function, void* self, vrpn_int32 sender) {
    const Handler handler = {type, function, self, sender};
    handlers_.push_back(handler);
    d_connection->register_handler(type, function, self, sender);
  }
  void send(vrpn_int32 type, const std::vector<vrpn_int32>& numbers) {
    if (d_connection == NULL) return;
    std::vector<char> payload(numbers.size() * sizeof(vrpn_int32) + 1);
    char* at = payload.data();
    vrpn_int32 left = static_cast<vrpn_int32>(payload.size());
    for (size_t i = 0; i < numbers.size(); ++i) vrpn_buffer(&at, &left, numbers[i]);
    struct timeval now;
    vrpn_gettimeofday(&now);
    d_connection->pack_message(static_cast<vrpn_uint32>(at - payload.data()), now, type, d_myId,
                               payload.data(), vrpn_CONNECTION_RELIABLE);
  }
  /// -1 at the end of the payload.
  static vrpn_int32 number(const vrpn_HANDLERPARAM& p, size_t index) {
    if (p.payload_len < static_cast<vrpn_int32>((index + 1) * sizeof(vrpn_int32))) return -1;
    const char* at = p.buffer + index * sizeof(vrpn_int32);
    return vrpn_unbuffer<vrpn_int32>(at);
  }

  vrpn_Connection* d_connection = NULL;
  vrpn_int32 d_myId = -1;
  vrpn_int32 d_requestIndex_type = -1;
  vrpn_int32 d_requestMutex_type = -1;
  vrpn_int32 d_release_type = -1;
  vrpn_int32 d_releaseNotification_type = -1;
  vrpn_int32 d_grantRequest_type = -1;
  vrpn_int32 d_denyRequest_type = -1;
  vrpn_int32 d_initialize_type = -1;

 private:
  struct Handler {
    vrpn_int32 type;
    vrpn_MESSAGEHANDLER function;
    void* self;
    vrpn_int32 sender;
  };
  std::vector<Handler> handlers_;
};

/// Grants the lock to one client at a time, and frees it when the last client has gone.
class vrpn_Mutex_Server : public vrpn_Mutex {
 public:
  vrpn_Mutex_Server(const char* name, vrpn_Connection* connection = NULL) : vrpn_Mutex(name, connection) {
    if (d_connection == NULL) return;
    on(d_requestIndex_type, onIndex, this, d_myId);
    on(d_requestMutex_type, onRequest, this, d_myId);
    on(d_release_type, onRelease, this, d_myId);
    on(d_connection->register_message_type(vrpn_dropped_last_connection), onEnd, this, vrpn_ANY_SENDER);
  }

 private:
  // Repeats how the client identified itself and adds its number.
  static int VRPN_CALLBACK onIndex(void* self, vrpn_HANDLERPARAM p) {
    vrpn_Mutex_Server* server = static_cast<vrpn_Mutex_Server*>(self);
    server->send(server->d_initialize_type, {number(p, 0), number(p, 1), server->nextIndex_++});
    return 0;
  }
  static int VRPN_CALLBACK onRequest(void* self, vrpn_HANDLERPARAM p) {
    vrpn_Mutex_Server* server = static_cast<vrpn_Mutex_Server*>(self);
    server->send(server->held_ ? server->d_denyRequest_type : server->d_grantRequest_type, {number(p, 0)});
    server->held_ = true;
    return 0;
  }
  static int VRPN_CALLBACK onRelease(void* self, vrpn_HANDLERPARAM) {
    vrpn_Mutex_Server* server = static_cast<vrpn_Mutex_Server*>(self);
    server->held_ = false;
    server->send(server->d_releaseNotification_type, {});
    return 0;
  }
  static int VRPN_CALLBACK onEnd(void* self, vrpn_HANDLERPARAM) {
    static_cast<vrpn_Mutex_Server*>(self)->held_ = false;
    return 0;
  }

  bool held_ = false;
  vrpn_int32 nextIndex_ = 0;
};

/// A client of the lock. The answer to request() comes by callback.
class vrpn_Mutex_Remote : public vrpn_Mutex {
 public:
  vrpn_Mutex_Remote(const char* name, vrpn_Connection* connection = NULL) : vrpn_Mutex(name, connection) {
    if (d_connection == NULL) return;
    on(d_grantRequest_type, onGrant, this, d_myId);
    on(d_denyRequest_type, onDeny, this, d_myId);
    on(d_releaseNotification_type, onRelease, this, d_myId);
    on(d_initialize_type, onIndex, this, d_myId);
    on(d_connection->register_message_type(vrpn_got_connection), onConnected, this, vrpn_ANY_SENDER);
    on(d_connection->register_message_type(vrpn_dropped_connection), onLost, this, vrpn_ANY_SENDER);
    if (d_connection->connected()) requestIndex();
  }
  /// Releases it, so that it is not held by nobody.
  virtual ~vrpn_Mutex_Remote() { release(); }

  vrpn_bool isAvailable() const { return state_ == AVAILABLE; }
  vrpn_bool isHeldLocally() const { return state_ == OURS; }
  vrpn_bool isHeldRemotely() const { return state_ == HELD_REMOTELY; }

  /// Denied at once while it is not available. Before the server has answered for the first time, waits for
  /// it.
  void request() {
    if (!isAvailable()) {
      call(denied_);
    } else if (index_ < 0) {
      requestsLater_ = true;
    } else {
      state_ = REQUESTING;
      send(d_requestMutex_type, {index_});
    }
  }
  /// Does nothing unless it is held here.
  void release() {
    if (!isHeldLocally()) return;
    state_ = AVAILABLE;
    send(d_release_type, {});
    call(released_);
  }

  typedef int (*Callback)(void* userdata);
  vrpn_bool addRequestGrantedCallback(void* userdata, Callback f) { return add(granted_, userdata, f); }
  vrpn_bool addRequestDeniedCallback(void* userdata, Callback f) { return add(denied_, userdata, f); }
  /// Called when anybody takes or releases it.
  vrpn_bool addTakeCallback(void* userdata, Callback f) { return add(taken_, userdata, f); }
  vrpn_bool addReleaseCallback(void* userdata, Callback f) { return add(released_, userdata, f); }

 private:
  enum State { OURS, REQUESTING, AVAILABLE, HELD_REMOTELY };
  typedef std::vector<std::pair<Callback, void*>> Callbacks;

  static vrpn_bool add(Callbacks& callbacks, void* userdata, Callback f) {
    callbacks.push_back(std::make_pair(f, userdata));
    return vrpn_true;
  }
  static void call(const Callbacks& callbacks) {
    for (size_t i = 0; i < callbacks.size(); ++i) callbacks[i].first(callbacks[i].second);
  }
  // Distinguishes the remotes of a program, too.
  vrpn_int32 identity() const { return static_cast<vrpn_int32>(reinterpret_cast<size_t>(this) >> 4); }
  // Once for each connection: a remote that was made on a live one may be told of it afterwards.
  void requestIndex() {
    if (index_ >= 0 || asked_) return;
    asked_ = true;
    send(d_requestIndex_type, {identity(), static_cast<vrpn_int32>(getpid())});
  }

  static int VRPN_CALLBACK onConnected(void* self, vrpn_HANDLERPARAM) {
    static_cast<vrpn_Mutex_Remote*>(self)->requestIndex();
    return 0;
  }
  static int VRPN_CALLBACK onLost(void* self, vrpn_HANDLERPARAM) {
    static_cast<vrpn_Mutex_Remote*>(self)->asked_ = false;
    return 0;
  }
  static int VRPN_CALLBACK onIndex(void* self, vrpn_HANDLERPARAM p) {
    vrpn_Mutex_Remote* remote = static_cast<vrpn_Mutex_Remote*>(self);
    if (remote->index_ >= 0 || number(p, 0) != remote->identity() || number(p, 1) != getpid()) return 0;
    remote->index_ = number(p, 2);
    if (remote->requestsLater_) remote->request();
    remote->requestsLater_ = false;
    return 0;
  }
  static int VRPN_CALLBACK onGrant(void* self, vrpn_HANDLERPARAM p) {
    vrpn_Mutex_Remote* remote = static_cast<vrpn_Mutex_Remote*>(self);
    const bool ours = number(p, 0) == remote->index_;
    remote->state_ = ours ? OURS : HELD_REMOTELY;
    if (ours) call(remote->granted_);
    call(remote->taken_);
    return 0;
  }
  static int VRPN_CALLBACK onDeny(void* self, vrpn_HANDLERPARAM p) {
    vrpn_Mutex_Remote* remote = static_cast<vrpn_Mutex_Remote*>(self);
    if (number(p, 0) != remote->index_) return 0;
    remote->state_ = HELD_REMOTELY;
    call(remote->denied_);
    return 0;
  }
  static int VRPN_CALLBACK onRelease(void* self, vrpn_HANDLERPARAM) {
    vrpn_Mutex_Remote* remote = static_cast<vrpn_Mutex_Remote*>(self);
    remote->state_ = AVAILABLE;
    call(remote->released_);
    return 0;
  }

  State state_ = AVAILABLE;
  vrpn_int32 index_ = -1;
  bool asked_ = false;
  bool requestsLater_ = false;
  Callbacks granted_, denied_, taken_, released_;
};

#endif
