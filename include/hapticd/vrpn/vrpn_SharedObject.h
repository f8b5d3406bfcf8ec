// A number or text that a server and its clients share: vrpn_Shared_int32, _float64, _String, each with a
// _Server and a _Remote. One of them, at first the server, is the serializer; with VRPN_SO_DEFER_UPDATES it
// decides which values count.
#ifndef VRPN_SHARED_OBJECT
#define VRPN_SHARED_OBJECT

#include <list>
#include <string>
#include <utility>

#include "vrpn_Connection.h"
#include "vrpn_LamportClock.h"
#include "vrpn_Shared.h"

/// Values of others are accepted, also ones that change nothing.
#define VRPN_SO_DEFAULT 0x00
#define VRPN_SO_IGNORE_IDEMPOTENT 0x01
/// A value counts when the serializer has sent it.
#define VRPN_SO_DEFER_UPDATES 0x10
/// A value with a time stamp that is not newer is ignored.
#define VRPN_SO_IGNORE_OLD 0x100

/// What a serializer does with values of others; vrpn_DENY_LOCAL refuses its own, too.
enum vrpn_SerializerPolicy { vrpn_ACCEPT, vrpn_DENY_REMOTE, vrpn_DENY_LOCAL, vrpn_CALLBACK };

typedef int(VRPN_CALLBACK* vrpnDeferredUpdateCallback)(void* userdata);

/// What does not depend on the type of the value.
class vrpn_SharedObject {
 public:
  vrpn_SharedObject(const char* name, const char* type, vrpn_int32 mode)
      : d_mode(mode), name_(name), type_(type) {
    vrpn_gettimeofday(&d_lastUpdate, NULL);
  }
  virtual ~vrpn_SharedObject() { unbind(); }
  vrpn_SharedObject(const vrpn_SharedObject&) = delete;
  vrpn_SharedObject& operator=(const vrpn_SharedObject&) = delete;

  const char* name() const { return name_.c_str(); }
  vrpn_bool isSerializer() const { return d_isSerializer; }
  /// Shares the value over this connection; NULL ends that.
  virtual void bindConnection(vrpn_Connection* connection) {
    if (connection == NULL) {
      unbind();
      return;
    }
    if (d_connection != NULL) {
      fprintf(stderr, "VRPN: %s is bound to a connection already\n", name());
      return;
    }
    d_connection = connection;
    d_connection->addReference();
    const std::string what = type_.substr(0, 100) + " " + name_.substr(0, 100);
    const vrpn_int32 server = connection->register_sender(("vrpn Shared server " + what).c_str());
    const vrpn_int32 peer = connection->register_sender(("vrpn Shared peer " + what).c_str());
    sender_ = serves() ? server : peer;
    other_ = serves() ? peer : server;
    update_ = connection->register_message_type("vrpn_Shared update");
    request_ = connection->register_message_type("vrpn_Shared request_serializer");
    grant_ = connection->register_message_type("vrpn_Shared grant_serializer");
    assume_ = connection->register_message_type("vrpn_Shared assume_serializer");
    connection->register_handler(update_, onUpdate, this, other_);
    connection->register_handler(request_, onRequest, this, other_);
    connection->register_handler(grant_, onGrant, this, other_);
    connection->register_handler(assume_, onAssume, this, other_);
    connection->register_handler(connection->register_message_type(vrpn_got_connection), onConnected, this,
                                 vrpn_ANY_SENDER);
  }
  /// VRPN's own library ignores the clock, too: the order of values is that of their time stamps.
  void useLamportClock(vrpn_LamportClock*) {}
  /// Asks the present serializer for its role; isSerializer() turns true when it has agreed.
  void becomeSerializer() {
    if (d_isSerializer || negotiating_) return;
    negotiating_ = true;
    send(request_, NULL, 0);
  }
  /// Called when a value that was set here waits for the serializer.
  vrpn_bool registerDeferredUpdateCallback(vrpnDeferredUpdateCallback callback, void* userdata) {
    deferred_.push_front(std::make_pair(callback, userdata));
    return true;
  }

 protected:
  virtual bool serves() const { return false; }
  /// Sends the present value.
  virtual void sendUpdate() = 0;
  /// Takes a value of the other side.
  virtual void receiveUpdate(const char* payload, vrpn_int32 length) = 0;

  void sendValue(const std::string& payload) { send(update_, payload.data(), payload.size()); }
  bool isOld(const struct timeval& when) const { return !vrpn_TimevalGreater(when, d_lastUpdate); }
  void callDeferred() {
    for (std::list<std::pair<vrpnDeferredUpdateCallback, void*> >::iterator c = deferred_.begin();
         c != deferred_.end() && c->first(c->second) == 0; ++c) {
    }
  }
  /// Whether the other side must know a value, for the serializer to decide or to follow its decision.
  bool mustSend(bool local, bool accepted) const {
    if (local && accepted) return true;
    if ((d_mode & VRPN_SO_DEFER_UPDATES) == 0) return false;
    return d_isSerializer ? !local && accepted : local;
  }

  vrpn_int32 d_mode;
  struct timeval d_lastUpdate;
  vrpn_bool d_isSerializer = VRPN_FALSE;
  vrpn_Connection* d_connection = NULL;

 private:
  void unbind() {
    if (d_connection == NULL) return;
    d_connection->unregister_handler(update_, onUpdate, this, other_);
    d_connection->unregister_handler(request_, onRequest, this, other_);
    d_connection->unregister_handler(grant_, onGrant, this, other_);
    d_connection->unregister_handler(assume_, onAssume, this, other_);
    d_connection->unregister_handler(d_connection->register_message_type(vrpn_got_connection), onConnected,
                                     this, vrpn_ANY_SENDER);
    d_connection->removeReference();
    d_connection = NULL;
  }
  void send(vrpn_int32 type, const char* payload, size_t length) {
    if (d_connection == NULL) return;
    d_connection->pack_message(static_cast<vrpn_uint32>(length), d_lastUpdate, type, sender_, payload,
                               vrpn_CONNECTION_RELIABLE);
  }
  static vrpn_SharedObject& of(void* self) { return *static_cast<vrpn_SharedObject*>(self); }
  static int VRPN_CALLBACK onUpdate(void* self, vrpn_HANDLERPARAM p) {
    of(self).receiveUpdate(p.buffer, p.payload_len);
    return 0;
  }
  static int VRPN_CALLBACK onRequest(void* self, vrpn_HANDLERPARAM) {
    vrpn_SharedObject& object = of(self);
    if (!object.d_isSerializer || object.negotiating_) return 0;
    object.negotiating_ = true;
    object.send(object.grant_, NULL, 0);
    return 0;
  }
  static int VRPN_CALLBACK onGrant(void* self, vrpn_HANDLERPARAM) {
    vrpn_SharedObject& object = of(self);
    object.d_isSerializer = VRPN_TRUE;
    object.negotiating_ = false;
    object.send(object.assume_, NULL, 0);
    return 0;
  }
  static int VRPN_CALLBACK onAssume(void* self, vrpn_HANDLERPARAM) {
    of(self).d_isSerializer = VRPN_FALSE;
    of(self).negotiating_ = false;
    return 0;
  }
  static int VRPN_CALLBACK onConnected(void* self, vrpn_HANDLERPARAM) {
    vrpn_SharedObject& object = of(self);
    const bool follows = (object.d_mode & VRPN_SO_DEFER_UPDATES) != 0;
    if (object.d_isSerializer || (object.serves() && !follows)) object.sendUpdate();
    return 0;
  }

  const std::string name_, type_;
  vrpn_int32 sender_ = -1, other_ = -1;
  vrpn_int32 update_ = -1, request_ = -1, grant_ = -1, assume_ = -1;
  bool negotiating_ = false;
  std::list<std::pair<vrpnDeferredUpdateCallback, void*> > deferred_;
};

// A shared value. `Traits` has the type that callers see (Value), the type that is kept (Kept), the name on
// the wire, and how a value and its time are written and read.
template <class Derived, class Traits>
class vrpn_Shared_Value : public vrpn_SharedObject {
 public:
  typedef typename Traits::Value Value;
  typedef int(VRPN_CALLBACK* Callback)(void* userdata, Value newValue, vrpn_bool isLocal);
  typedef int(VRPN_CALLBACK* TimedCallback)(void* userdata, Value newValue, timeval when, vrpn_bool isLocal);
  typedef int(VRPN_CALLBACK* Policy)(void* userdata, Value newValue, timeval when, Derived* object);

  vrpn_Shared_Value(const char* name, Value initial, vrpn_int32 mode)
      : vrpn_SharedObject(name, Traits::name(), mode), value_(Traits::kept(initial)) {}

  Value value() const { return Traits::shown(value_); }
  operator Value() const { return value(); }
  Derived& set(Value newValue, timeval when) {
    setFrom(Traits::kept(newValue), when, true);
    return static_cast<Derived&>(*this);
  }
  Derived& set(Value newValue) {
    timeval now;
    vrpn_gettimeofday(&now, NULL);
    return set(newValue, now);
  }
  /// Called, the last one registered first, with each value that counts.
  vrpn_bool register_handler(Callback callback, void* userdata) {
    callbacks_.push_front(std::make_pair(callback, userdata));
    return true;
  }
  vrpn_bool register_handler(TimedCallback callback, void* userdata) {
    timed_.push_front(std::make_pair(callback, userdata));
    return true;
  }
  void unregister_handler(Callback callback, void* userdata) {
    callbacks_.remove(std::make_pair(callback, userdata));
  }
  void unregister_handler(TimedCallback callback, void* userdata) {
    timed_.remove(std::make_pair(callback, userdata));
  }
  /// With vrpn_CALLBACK a value of another counts when the function returns non-zero.
  void setSerializerPolicy(vrpn_SerializerPolicy policy = vrpn_ACCEPT, Policy function = NULL,
                           void* userdata = NULL) {
    policy_ = policy;
    policyFunction_ = function;
    policyUserdata_ = userdata;
  }

 protected:
  virtual void sendUpdate() { sendValue(Traits::write(value_, d_lastUpdate)); }
  virtual void receiveUpdate(const char* payload, vrpn_int32 length) {
    typename Traits::Kept newValue = typename Traits::Kept();
    timeval when;
    if (Traits::read(payload, length, newValue, when)) setFrom(newValue, when, false);
  }

 private:
  void setFrom(const typename Traits::Kept& newValue, const timeval& when, bool local) {
    const bool accepted = accepts(newValue, when, local);
    if (accepted) {
      value_ = newValue;
      d_lastUpdate = when;
    }
    if (mustSend(local, accepted)) sendValue(Traits::write(newValue, when));
    if (accepted) callAll(local);
  }
  bool accepts(const typename Traits::Kept& newValue, const timeval& when, bool local) {
    if ((d_mode & VRPN_SO_IGNORE_IDEMPOTENT) != 0 && newValue == value_) return false;
    if ((d_mode & VRPN_SO_IGNORE_OLD) != 0 && isOld(when)) return false;
    if ((d_mode & VRPN_SO_DEFER_UPDATES) == 0) return true;
    if (!d_isSerializer) {
      if (local) callDeferred();
      return !local;
    }
    if (local) return policy_ != vrpn_DENY_LOCAL;
    if (policy_ == vrpn_ACCEPT) return true;
    return policy_ == vrpn_CALLBACK && policyFunction_ != NULL &&
           policyFunction_(policyUserdata_, Traits::shown(newValue), when, static_cast<Derived*>(this)) != 0;
  }
  void callAll(bool local) {
    const vrpn_bool isLocal = local ? VRPN_TRUE : VRPN_FALSE;
    const std::list<std::pair<Callback, void*> > callbacks = callbacks_;
    for (typename std::list<std::pair<Callback, void*> >::const_iterator c = callbacks.begin();
         c != callbacks.end(); ++c) {
      if (c->first(c->second, value(), isLocal) != 0) return;
    }
    const std::list<std::pair<TimedCallback, void*> > timed = timed_;
    for (typename std::list<std::pair<TimedCallback, void*> >::const_iterator c = timed.begin();
         c != timed.end(); ++c) {
      if (c->first(c->second, value(), d_lastUpdate, isLocal) != 0) return;
    }
  }

  typename Traits::Kept value_;
  std::list<std::pair<Callback, void*> > callbacks_;
  std::list<std::pair<TimedCallback, void*> > timed_;
  vrpn_SerializerPolicy policy_ = vrpn_ACCEPT;
  Policy policyFunction_ = NULL;
  void* policyUserdata_ = NULL;
};

// A number, then its time.
template <class Number>
struct vrpn_Shared_Number {
  typedef Number Value;
  typedef Number Kept;
  static const char* name() { return sizeof(Number) == 4 ? "int32" : "float64"; }
  static Kept kept(Value value) { return value; }
  static Value shown(Kept value) { return value; }
  static std::string write(Kept value, const timeval& when) {
    char bytes[sizeof(Number) + 8];
    char* at = bytes;
    vrpn_int32 left = sizeof(bytes);
    vrpn_buffer(&at, &left, value);
    vrpn_buffer(&at, &left, when);
    return std::string(bytes, sizeof(bytes));
  }
  static bool read(const char* bytes, vrpn_int32 length, Kept& value, timeval& when) {
    if (length != static_cast<vrpn_int32>(sizeof(Number) + 8)) return false;
    vrpn_unbuffer(&bytes, &value);
    vrpn_unbuffer(&bytes, &when);
    return true;
  }
};

// The time, then the characters without an end mark. VRPN's library on 64-bit machines reads eight too few.
struct vrpn_Shared_Characters {
  typedef const char* Value;
  typedef std::string Kept;
  static const char* name() { return "String"; }
  static Kept kept(Value value) { return value != NULL ? value : ""; }
  static Value shown(const Kept& value) { return value.c_str(); }
  static std::string write(const Kept& value, const timeval& when) {
    char time[8];
    char* at = time;
    vrpn_int32 left = sizeof(time);
    vrpn_buffer(&at, &left, when);
    return std::string(time, sizeof(time)) + value;
  }
  static bool read(const char* bytes, vrpn_int32 length, Kept& value, timeval& when) {
    if (length < 8) return false;
    vrpn_unbuffer(&bytes, &when);
    value.assign(bytes, static_cast<size_t>(length) - 8);
    return true;
  }
};

#define HAPTICD_VRPN_SHARED(NAME, TRAITS, INITIAL)                                                       \
  class NAME : public vrpn_Shared_Value<NAME, TRAITS> {                                                  \
   public:                                                                                               \
    explicit NAME(const char* name, Value initial = INITIAL, vrpn_int32 mode = VRPN_SO_DEFAULT)          \
        : vrpn_Shared_Value<NAME, TRAITS>(name, initial, mode) {}                                        \
    NAME& operator=(Value newValue) { return set(newValue); }                                            \
  };                                                                                                     \
  class NAME##_Server : public NAME {                                                                    \
   public:                                                                                               \
    explicit NAME##_Server(const char* name, Value initial = INITIAL, vrpn_int32 mode = VRPN_SO_DEFAULT) \
        : NAME(name, initial, mode) {                                                                    \
      d_isSerializer = VRPN_TRUE;                                                                        \
    }                                                                                                    \
    NAME##_Server& operator=(Value newValue) {                                                           \
      set(newValue);                                                                                     \
      return *this;                                                                                      \
    }                                                                                                    \
                                                                                                         \
   protected:                                                                                            \
    virtual bool serves() const { return true; }                                                         \
  };                                                                                                     \
  class NAME##_Remote : public NAME {                                                                    \
   public:                                                                                               \
    explicit NAME##_Remote(const char* name, Value initial = INITIAL, vrpn_int32 mode = VRPN_SO_DEFAULT) \
        : NAME(name, initial, mode) {}                                                                   \
    NAME##_Remote& operator=(Value newValue) {                                                           \
      set(newValue);                                                                                     \
      return *this;                                                                                      \
    }                                                                                                    \
  };

HAPTICD_VRPN_SHARED(vrpn_Shared_int32, vrpn_Shared_Number<vrpn_int32>, 0)
HAPTICD_VRPN_SHARED(vrpn_Shared_float64, vrpn_Shared_Number<vrpn_float64>, 0)
HAPTICD_VRPN_SHARED(vrpn_Shared_String, vrpn_Shared_Characters, NULL)
#undef HAPTICD_VRPN_SHARED

typedef vrpn_Shared_int32::Callback vrpnSharedIntCallback;
typedef vrpn_Shared_float64::Callback vrpnSharedFloatCallback;
typedef vrpn_Shared_String::Callback vrpnSharedStringCallback;
typedef vrpn_Shared_int32::TimedCallback vrpnTimedSharedIntCallback;
typedef vrpn_Shared_float64::TimedCallback vrpnTimedSharedFloatCallback;
typedef vrpn_Shared_String::TimedCallback vrpnTimedSharedStringCallback;
typedef vrpn_Shared_int32::Policy vrpnSharedIntSerializerPolicy;
typedef vrpn_Shared_float64::Policy vrpnSharedFloatSerializerPolicy;
typedef vrpn_Shared_String::Policy vrpnSharedStringSerializerPolicy;

#endif
