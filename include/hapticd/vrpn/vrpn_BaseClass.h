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

/// Prints the text messages of all devices to standard output.
class VRPN_API vrpn_TextPrinter {
 public:
  void set_min_level_to_print(vrpn_TEXT_SEVERITY severity, vrpn_uint32 level = 0);
  /// NULL prints nothing.
  void set_ostream_to_use(FILE* stream) { stream_ = stream; }
  int add_object(vrpn_BaseClass* device);
  void remove_object(vrpn_BaseClass* device);

 private:
  friend class vrpn_BaseClass;
  void print(const vrpn_BaseClass* device, const vrpn_HANDLERPARAM& p) const;

  std::vector<vrpn_BaseClass*> devices_;
  FILE* stream_ = stdout;
  vrpn_TEXT_SEVERITY severity_ = vrpn_TEXT_WARNING;
  vrpn_uint32 level_ = 0;
};
extern VRPN_API vrpn_TextPrinter& vrpn_System_TextPrinter;

class VRPN_API vrpn_BaseClass {
 public:
  /// Opens NAME@server, or the device NAME of the given connection.
  vrpn_BaseClass(const char* name, vrpn_Connection* connection = NULL);
  virtual ~vrpn_BaseClass();
  vrpn_BaseClass(const vrpn_BaseClass&) = delete;
  vrpn_BaseClass& operator=(const vrpn_BaseClass&) = delete;

  vrpn_Connection* connectionPtr() { return d_connection; }
  virtual void mainloop() = 0;

  /// A text message of one severity: what send_text_message(severity) returns.
  class SendTextMessageBoundCall {
   public:
    SendTextMessageBoundCall(vrpn_BaseClass* device, vrpn_TEXT_SEVERITY severity)
        : device_(device), severity_(severity) {}
    int operator()(const char* text) const {
      struct timeval now;
      vrpn_gettimeofday(&now);
      return device_->send_text_message(text, now, severity_);
    }

   private:
    vrpn_BaseClass* device_;
    vrpn_TEXT_SEVERITY severity_;
  };

  /// Suppresses the warning about a server that does not answer.
  bool shutup = false;

 protected:
  friend class vrpn_TextPrinter;

  // For derived device classes: init() calls both.
  virtual int init();
  virtual int register_senders() { return 0; }
  virtual int register_types() { return 0; }

  int register_autodeleted_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                   vrpn_int32 sender = vrpn_ANY_SENDER);
  /// The same for a message of this device, by the name of the message.
  void listen(const char* type, vrpn_MESSAGEHANDLER handler);
  int send_text_message(const char* text, struct timeval time, vrpn_TEXT_SEVERITY severity = vrpn_TEXT_NORMAL,
                        vrpn_uint32 level = 0);
  SendTextMessageBoundCall send_text_message(vrpn_TEXT_SEVERITY severity) {
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
  /// Runs the connection, and prints a warning while the device does not answer.
  void client_mainloop();

  vrpn_Connection* d_connection;
  char* d_servicename;
  vrpn_int32 d_sender_id = -1;
  vrpn_int32 d_text_message_id = -1;
  vrpn_int32 d_ping_message_id = -1;
  vrpn_int32 d_pong_message_id = -1;

 private:
  struct Registered {
    vrpn_int32 type;
    vrpn_MESSAGEHANDLER handler;
    void* userdata;
    vrpn_int32 sender;
  };
  static int VRPN_CALLBACK handleText(void* self, vrpn_HANDLERPARAM p);

  std::vector<Registered> registered_;
  struct timeval silentSince_ = {};
  int warned_s_ = 0;
};
typedef vrpn_BaseClass vrpn_BaseClassUnique;

/// Handlers of one kind of report. A running handler may unregister itself and others.
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
    ++calling_;
    for (size_t i = 0; i < entries_.size(); ++i) {
      const Entry entry = entries_[i];
      if (entry.handler != NULL) entry.handler(entry.userdata, info);
    }
    if (--calling_ == 0) sweep();
  }

 private:
  struct Entry {
    void* userdata;
    HANDLER_TYPE handler;
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
