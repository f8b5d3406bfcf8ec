// The base of all devices: a name on a connection, and text messages.
#ifndef VRPN_BASECLASS
#define VRPN_BASECLASS

#include <stdio.h>

#include <vector>

#include "vrpn_Configure.h"
#include "vrpn_Connection.h"
#include "vrpn_Shared.h"
#include "vrpn_Types.h"

typedef enum { vrpn_TEXT_NORMAL = 0, vrpn_TEXT_WARNING = 1, vrpn_TEXT_ERROR = 2 } vrpn_TEXT_SEVERITY;
const unsigned vrpn_MAX_TEXT_LEN = 1024;

class vrpn_BaseClass;
class vrpn_BaseClassUnique;

/// Prints the text messages of its devices to standard output, at first only warnings and errors. Those of a
/// device that several objects of a program stand for are printed once, until one of them is removed.
class VRPN_API vrpn_TextPrinter {
 public:
  vrpn_TextPrinter();
  ~vrpn_TextPrinter();
  vrpn_TextPrinter(const vrpn_TextPrinter&) = delete;
  vrpn_TextPrinter& operator=(const vrpn_TextPrinter&) = delete;

  void set_min_level_to_print(vrpn_TEXT_SEVERITY severity, vrpn_uint32 level = 0);
  /// NULL prints nothing.
  void set_ostream_to_use(FILE* stream);
  /// -1 for NULL.
  int add_object(vrpn_BaseClass* device);
  void remove_object(vrpn_BaseClass* device);

 private:
  friend class vrpn_BaseClassUnique;
  void add(vrpn_BaseClassUnique* device);
  void print(const vrpn_BaseClassUnique* device, const vrpn_HANDLERPARAM& p) const;

  std::vector<vrpn_BaseClassUnique*> devices_;
  FILE* stream_ = stdout;
  vrpn_TEXT_SEVERITY severity_ = vrpn_TEXT_WARNING;
  vrpn_uint32 level_ = 0;
};
/// Prints the texts of all devices.
extern VRPN_API vrpn_TextPrinter& vrpn_System_TextPrinter;

/// What a device has once, however many device classes it is made of: name, connection, texts and pings.
class VRPN_API vrpn_BaseClassUnique {
 public:
  vrpn_BaseClassUnique() {}
  virtual ~vrpn_BaseClassUnique();
  vrpn_BaseClassUnique(const vrpn_BaseClassUnique&) = delete;
  vrpn_BaseClassUnique& operator=(const vrpn_BaseClassUnique&) = delete;

  vrpn_Connection* connectionPtr() { return d_connection; }

  /// A text message of one severity: what send_text_message(severity) returns.
  class SendTextMessageBoundCall {
   public:
    SendTextMessageBoundCall(vrpn_BaseClassUnique* device, vrpn_TEXT_SEVERITY severity)
        : device_(device), severity_(severity) {}
    int operator()(const char* text) const {
      struct timeval now;
      vrpn_gettimeofday(&now);
      return device_->send_text_message(text, now, severity_);
    }

   private:
    vrpn_BaseClassUnique* device_;
    vrpn_TEXT_SEVERITY severity_;
  };

  /// Suppresses the warning about a server that does not answer.
  bool shutup = false;

 protected:
  friend class vrpn_TextPrinter;

  int register_autodeleted_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                   vrpn_int32 sender = vrpn_ANY_SENDER);
  /// -1 for a text of vrpn_MAX_TEXT_LEN characters or more, which is not sent.
  int send_text_message(const char* text, struct timeval time, vrpn_TEXT_SEVERITY severity = vrpn_TEXT_NORMAL,
                        vrpn_uint32 level = 0);
  SendTextMessageBoundCall send_text_message(vrpn_TEXT_SEVERITY severity = vrpn_TEXT_NORMAL) {
    return SendTextMessageBoundCall(this, severity);
  }
  /// The payload of a text message: 2 * 4 + vrpn_MAX_TEXT_LEN bytes.
  static int encode_text_message_to_buffer(char* buffer, vrpn_TEXT_SEVERITY severity, vrpn_uint32 level,
                                           const char* text) {
    vrpn_int32 left = 2 * sizeof(vrpn_uint32) + vrpn_MAX_TEXT_LEN;
    vrpn_buffer(&buffer, &left, static_cast<vrpn_uint32>(severity));
    vrpn_buffer(&buffer, &left, level);
    return vrpn_buffer(&buffer, &left, text, -1);
  }
  static int decode_text_message_from_buffer(char* text, vrpn_TEXT_SEVERITY* severity, vrpn_uint32* level,
                                             const char* buffer) {
    vrpn_uint32 number = 0;
    vrpn_unbuffer(&buffer, &number);
    *severity = static_cast<vrpn_TEXT_SEVERITY>(number);
    vrpn_unbuffer(&buffer, level);
    return vrpn_unbuffer(&buffer, text, -static_cast<vrpn_int32>(vrpn_MAX_TEXT_LEN));
  }
  /// For the mainloop() of a server's device: from the first call on, pings of clients are answered. The
  /// program itself runs the connection.
  void server_mainloop();
  /// For the mainloop() of a client's device: runs the connection, and prints a warning while the device does
  /// not answer.
  void client_mainloop();

  vrpn_Connection* d_connection = NULL;
  char* d_servicename = NULL;
  vrpn_int32 d_sender_id = -1;
  vrpn_int32 d_text_message_id = -1;
  vrpn_int32 d_ping_message_id = -1;
  vrpn_int32 d_pong_message_id = -1;

 private:
  friend class vrpn_BaseClass;
  struct Registered {
    vrpn_int32 type;
    vrpn_MESSAGEHANDLER handler;
    void* userdata;
    vrpn_int32 sender;
  };
  void open(const char* name, vrpn_Connection* connection);
  bool isSameDevice(const vrpn_BaseClassUnique& other) const {
    return d_connection == other.d_connection && d_sender_id == other.d_sender_id;
  }
  static int VRPN_CALLBACK handleText(void* self, vrpn_HANDLERPARAM p);
  static int VRPN_CALLBACK handlePing(void* self, vrpn_HANDLERPARAM p);

  std::vector<Registered> registered_;
  struct timeval silentSince_ = {};
  int warned_s_ = 0;
  bool started_ = false;  // by its first mainloop
};

/// The base of each device class. A device made of several classes has one name and one connection.
class VRPN_API vrpn_BaseClass : public virtual vrpn_BaseClassUnique {
 public:
  /// Opens NAME@server, or the device NAME of the given connection.
  vrpn_BaseClass(const char* name, vrpn_Connection* connection = NULL);
  virtual ~vrpn_BaseClass();

  virtual void mainloop() = 0;

 protected:
  // For derived device classes: init() calls both.
  virtual int init();
  virtual int register_senders() { return 0; }
  virtual int register_types() { return 0; }

  /// Registers a handler for a message of this device, by the name of the message; `self` is its userdata.
  void listen(const char* type, vrpn_MESSAGEHANDLER handler, void* self);
};

/// Handlers of one kind of report; the last registered is called first, as in VRPN. A running handler may
/// unregister itself and others.
template <class Report>
class VRPN_API vrpn_Callback_List {
 public:
  typedef void(VRPN_CALLBACK* HANDLER_TYPE)(void* userdata, const Report info);

  int register_handler(void* userdata, HANDLER_TYPE handler) {
    if (handler == NULL) return -1;
    entries_.push_back({userdata, handler});
    return 0;
  }
  int unregister_handler(void* userdata, HANDLER_TYPE handler) {
    for (size_t i = 0; i < entries_.size(); ++i) {
      if (entries_[i].userdata == userdata && entries_[i].handler == handler) {
        entries_[i].handler = NULL;
        if (calling_ == 0) sweep();
        return 0;
      }
    }
    fprintf(stderr, "VRPN: no such handler is registered\n");
    return -1;
  }
  void call_handlers(const Report& info) {
    const Call call(*this);
    for (size_t i = entries_.size(); i-- > 0;) {
      const Entry entry = entries_[i];
      if (entry.handler != NULL) entry.handler(entry.userdata, info);
    }
  }

 private:
  struct Entry {
    void* userdata;
    HANDLER_TYPE handler;
  };
  // Also when a handler throws.
  struct Call {
    explicit Call(vrpn_Callback_List& list) : of(list) { ++of.calling_; }
    ~Call() {
      if (--of.calling_ == 0) of.sweep();
    }
    vrpn_Callback_List& of;
  };
  void sweep() {
    size_t kept = 0;
    for (size_t i = 0; i < entries_.size(); ++i) {
      if (entries_[i].handler != NULL) entries_[kept++] = entries_[i];
    }
    entries_.resize(kept);
  }

  std::vector<Entry> entries_;
  int calling_ = 0;
};

#endif
