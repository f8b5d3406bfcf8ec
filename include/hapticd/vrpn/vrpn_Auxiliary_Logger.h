// Requests to log a connection elsewhere. This library writes no log files: a server is what the program
// derives.
#ifndef VRPN_AUXILIARY_LOGGER_H
#define VRPN_AUXILIARY_LOGGER_H

#include <string>
#include <vector>

#include "vrpn_BaseClass.h"

/// The messages: four names of files. NULL and "" are no file; handlers get NULL.
class vrpn_Auxiliary_Logger : public vrpn_BaseClass {
 public:
  vrpn_Auxiliary_Logger(const char* name, vrpn_Connection* connection = NULL)
      : vrpn_BaseClass(name, connection) {
    if (d_connection == NULL) return;
    request_logging_m_id = d_connection->register_message_type("vrpn_Auxiliary_Logger Logging_request");
    report_logging_m_id = d_connection->register_message_type("vrpn_Auxiliary_Logger Logging_response");
    request_logging_status_m_id =
        d_connection->register_message_type("vrpn_Auxiliary_Logger Logging_status_request");
  }

 protected:
  bool pack_log_message_of_type(vrpn_int32 type, const char* local_in, const char* local_out,
                                const char* remote_in, const char* remote_out) {
    if (d_connection == NULL) return false;
    const char* const files[4] = {local_in, local_out, remote_in, remote_out};
    std::string names;
    char lengths[4 * sizeof(vrpn_int32)];
    char* at = lengths;
    vrpn_int32 left = sizeof lengths;
    for (int i = 0; i < 4; ++i) {
      const std::string file = files[i] != NULL ? files[i] : "";
      vrpn_buffer(&at, &left, static_cast<vrpn_int32>(file.size()));
      names += file;
    }
    const std::string payload = std::string(lengths, sizeof lengths) + names;
    struct timeval now;
    vrpn_gettimeofday(&now);
    return d_connection->pack_message(static_cast<vrpn_uint32>(payload.size()), now, type, d_sender_id,
                                      payload.data(), vrpn_CONNECTION_RELIABLE) == 0;
  }
  /// False for a damaged message.
  static bool unpack(const vrpn_HANDLERPARAM& p, std::string (&files)[4]) {
    const char* at = p.buffer;
    vrpn_int32 lengths[4];
    vrpn_int32 left = p.payload_len - static_cast<vrpn_int32>(sizeof lengths);
    if (left < 0) return false;
    for (int i = 0; i < 4; ++i) vrpn_unbuffer(&at, &lengths[i]);
    for (int i = 0; i < 4; ++i) {
      if (lengths[i] < 0 || lengths[i] > left) return false;
      files[i].assign(at, static_cast<size_t>(lengths[i]));
      at += lengths[i];
      left -= lengths[i];
    }
    return left == 0;
  }

  static const char* nameOrNull(const std::string& file) { return file.empty() ? NULL : file.c_str(); }

  vrpn_int32 request_logging_m_id = -1;
  vrpn_int32 report_logging_m_id = -1;
  vrpn_int32 request_logging_status_m_id = -1;
};

class vrpn_Auxiliary_Logger_Server : public vrpn_Auxiliary_Logger {
 public:
  vrpn_Auxiliary_Logger_Server(const char* name, vrpn_Connection* connection)
      : vrpn_Auxiliary_Logger(name, connection) {
    if (d_connection == NULL) return;
    register_autodeleted_handler(request_logging_m_id, onRequest, this, d_sender_id);
    register_autodeleted_handler(request_logging_status_m_id, onStatusRequest, this, d_sender_id);
    register_autodeleted_handler(d_connection->register_message_type(vrpn_dropped_last_connection), onEnd,
                                 this);
  }
  virtual void mainloop() { server_mainloop(); }

 protected:
  virtual void handle_request_logging(const char* local_in, const char* local_out, const char* remote_in,
                                      const char* remote_out) = 0;
  virtual void handle_request_logging_status() = 0;
  /// Ends logging.
  virtual void handle_dropped_last_connection() { handle_request_logging("", "", "", ""); }
  bool send_report_logging(const char* local_in, const char* local_out, const char* remote_in,
                           const char* remote_out) {
    return pack_log_message_of_type(report_logging_m_id, local_in, local_out, remote_in, remote_out);
  }

 private:
  static int VRPN_CALLBACK onRequest(void* self, vrpn_HANDLERPARAM p) {
    std::string files[4];
    if (!unpack(p, files)) return 0;
    static_cast<vrpn_Auxiliary_Logger_Server*>(self)->handle_request_logging(
        nameOrNull(files[0]), nameOrNull(files[1]), nameOrNull(files[2]), nameOrNull(files[3]));
    return 0;
  }
  static int VRPN_CALLBACK onStatusRequest(void* self, vrpn_HANDLERPARAM) {
    static_cast<vrpn_Auxiliary_Logger_Server*>(self)->handle_request_logging_status();
    return 0;
  }
  static int VRPN_CALLBACK onEnd(void* self, vrpn_HANDLERPARAM) {
    static_cast<vrpn_Auxiliary_Logger_Server*>(self)->handle_dropped_last_connection();
    return 0;
  }
};

typedef struct _vrpn_AUXLOGGERCB {
  struct timeval msg_time;
  const char* local_in_logfile_name;
  const char* local_out_logfile_name;
  const char* remote_in_logfile_name;
  const char* remote_out_logfile_name;
} vrpn_AUXLOGGERCB;
typedef void(VRPN_CALLBACK* vrpn_AUXLOGGERREPORTHANDLER)(void* userdata, const vrpn_AUXLOGGERCB info);

class vrpn_Auxiliary_Logger_Remote : public vrpn_Auxiliary_Logger {
 public:
  vrpn_Auxiliary_Logger_Remote(const char* name, vrpn_Connection* connection = NULL)
      : vrpn_Auxiliary_Logger(name, connection) {
    listen("vrpn_Auxiliary_Logger Logging_response", onReport, this);
  }
  virtual void mainloop() { client_mainloop(); }
  bool send_logging_request(const char* local_in, const char* local_out = "", const char* remote_in = "",
                            const char* remote_out = "") {
    return pack_log_message_of_type(request_logging_m_id, local_in, local_out, remote_in, remote_out);
  }
  bool send_logging_status_request() {
    return pack_log_message_of_type(request_logging_status_m_id, NULL, NULL, NULL, NULL);
  }
  virtual int register_report_handler(void* userdata, vrpn_AUXLOGGERREPORTHANDLER handler) {
    return reports_.register_handler(userdata, handler);
  }
  virtual int unregister_report_handler(void* userdata, vrpn_AUXLOGGERREPORTHANDLER handler) {
    return reports_.unregister_handler(userdata, handler);
  }

 private:
  static int VRPN_CALLBACK onReport(void* self, vrpn_HANDLERPARAM p) {
    std::string files[4];
    if (!unpack(p, files)) return 0;
    const vrpn_AUXLOGGERCB report = {p.msg_time, nameOrNull(files[0]), nameOrNull(files[1]),
                                     nameOrNull(files[2]), nameOrNull(files[3])};
    static_cast<vrpn_Auxiliary_Logger_Remote*>(self)->reports_.call_handlers(report);
    return 0;
  }

  vrpn_Callback_List<vrpn_AUXLOGGERCB> reports_;
};

#endif
