// Both sides of a room of shared objects as people write them for VRPN: numbers, a text, a lock, a logger,
// redundant messages, messages forwarded to another port, and requests of poses, outputs and playback. They
// compile with VRPN's own headers, too; testdata/vrpn_room has what they said when they were linked with
// VRPN.
#pragma once

#include <stdio.h>
#include <string.h>
#include <vrpn_Analog_Output.h>
#include <vrpn_Auxiliary_Logger.h>
#include <vrpn_Connection.h>
#include <vrpn_FileController.h>
#include <vrpn_ForwarderController.h>
#include <vrpn_Mutex.h>
#include <vrpn_Poser.h>
#include <vrpn_RedundantTransmission.h>
#include <vrpn_SharedObject.h>

#include <string>

enum { kRoomSteps = 7, kForwardedPort = 4500 };

inline struct timeval roomTime(long seconds) {
  struct timeval time;
  time.tv_sec = 2000000000 + seconds;  // newer than when the values are made
  time.tv_usec = 250000;
  return time;
}

inline const char* named(const char* file) {
  return file != NULL ? file : "NULL";
}

/// Tells the other side what was seen.
class RoomSpeaker {
 public:
  RoomSpeaker(const char* name, vrpn_Connection* connection)
      : connection_(connection),
        sender_(connection->register_sender(name)),
        seen_(connection->register_message_type("Room Seen")),
        step_(connection->register_message_type("Room Step")) {}

  void say(const char* text) { send(seen_, text, strlen(text)); }
  void say(const char* what, double number, bool local) {
    char text[200];
    snprintf(text, sizeof text, "%s %g %s", what, number, local ? "here" : "there");
    say(text);
  }
  void step(char number) { send(step_, &number, 1); }

 private:
  void send(vrpn_int32 type, const char* payload, size_t length) {
    connection_->pack_message(static_cast<vrpn_uint32>(length), roomTime(1), type, sender_, payload,
                              vrpn_CONNECTION_RELIABLE);
  }

  vrpn_Connection* connection_;
  vrpn_int32 sender_, seen_, step_;
};

inline int VRPN_CALLBACK roomNumber(void* speaker, vrpn_int32 value, vrpn_bool local) {
  static_cast<RoomSpeaker*>(speaker)->say("number", value, local != 0);
  return 0;
}
inline int VRPN_CALLBACK roomLength(void* speaker, vrpn_float64 value, struct timeval when, vrpn_bool local) {
  static_cast<RoomSpeaker*>(speaker)->say("length", value + static_cast<double>(when.tv_sec - 2000000000),
                                          local != 0);
  return 0;
}
inline int VRPN_CALLBACK roomText(void* speaker, const char* value, vrpn_bool local) {
  static_cast<RoomSpeaker*>(speaker)->say(value, 0, local != 0);
  return 0;
}

class RoomLogger : public vrpn_Auxiliary_Logger_Server {
 public:
  RoomLogger(vrpn_Connection* connection, RoomSpeaker* speaker)
      : vrpn_Auxiliary_Logger_Server("Logger", connection), speaker_(speaker) {}

 protected:
  virtual void handle_request_logging(const char* in, const char* out, const char* farIn,
                                      const char* farOut) {
    char text[200];
    snprintf(text, sizeof text, "log %s,%s,%s,%s", named(in), named(out), named(farIn), named(farOut));
    speaker_->say(text);
    send_report_logging(in, out, farIn, farOut);
  }
  virtual void handle_request_logging_status() { send_report_logging("", "a", "", "bcd"); }
  virtual void handle_dropped_last_connection() {}

 private:
  RoomSpeaker* speaker_;
};

class RoomServer {
 public:
  explicit RoomServer(vrpn_Connection* connection)
      : connection_(connection),
        speaker_("Room Server", connection),
        number_("number", 3),
        length_("length", 1.5, VRPN_SO_IGNORE_OLD | VRPN_SO_IGNORE_IDEMPOTENT),
        text_("text", "a long enough text"),
        lock_("Lock", connection),
        redundant_(connection),
        controller_(&redundant_, connection),
        logger_(connection, &speaker_),
        forwarder_(connection) {
    number_.set(4, roomTime(10));
    length_.set(2.5, roomTime(10));
    text_.set("the first text of the server", roomTime(10));
    number_.register_handler(roomNumber, &speaker_);
    length_.register_handler(roomLength, &speaker_);
    text_.register_handler(roomText, &speaker_);
    number_.bindConnection(connection);
    length_.bindConnection(connection);
    text_.bindConnection(connection);
    connection->register_handler(connection->register_message_type("Room Step"), onStep, this,
                                 connection->register_sender("Room Client"));
  }
  ~RoomServer() {
    connection_->unregister_handler(connection_->register_message_type("Room Step"), onStep, this,
                                    connection_->register_sender("Room Client"));
  }
  void mainloop() {
    controller_.mainloop();
    logger_.mainloop();
    redundant_.mainloop();
    forwarder_.mainloop();
    connection_->mainloop();
  }
  vrpn_Forwarder_Server& forwarder() { return forwarder_; }

 private:
  static int VRPN_CALLBACK onStep(void* self, vrpn_HANDLERPARAM p) {
    static_cast<RoomServer*>(self)->step(p.buffer[0]);
    return 0;
  }
  void step(char number) {
    if (number == 2) {
      number_.set(5, roomTime(20));
      length_.set(3.5, roomTime(20));
      length_.set(9.5, roomTime(15));
      length_.set(3.5, roomTime(30));
      text_.set("another text that is long", roomTime(20));
    }
    if (number == 4) {
      char text[200];
      snprintf(text, sizeof text, "redundant %u %ld.%06ld %d",
               static_cast<unsigned>(redundant_.defaultRetransmissions()),
               static_cast<long>(redundant_.defaultInterval().tv_sec),
               static_cast<long>(redundant_.defaultInterval().tv_usec), redundant_.isEnabled() ? 1 : 0);
      speaker_.say(text);
      for (char c = 'a'; c < 'd'; ++c) sign(c, c - 'a');
    }
    if (number == kRoomSteps) {
      for (char c = 'x'; c <= 'z'; ++c) sign(c, 0);
    }
    speaker_.step(number);
  }
  void sign(char c, vrpn_int32 repetitions) {
    struct timeval atOnce;
    atOnce.tv_sec = atOnce.tv_usec = 0;
    redundant_.pack_message(1, roomTime(100 + c),
                            static_cast<vrpn_uint32>(connection_->register_message_type("Room Sign")),
                            static_cast<vrpn_uint32>(connection_->register_sender("Room Server")), &c,
                            vrpn_CONNECTION_RELIABLE, repetitions, &atOnce);
  }

  vrpn_Connection* connection_;
  RoomSpeaker speaker_;
  vrpn_Shared_int32_Server number_;
  vrpn_Shared_float64_Server length_;
  vrpn_Shared_String_Server text_;
  vrpn_Mutex_Server lock_;
  vrpn_RedundantTransmission redundant_;
  vrpn_RedundantController controller_;
  RoomLogger logger_;
  vrpn_Forwarder_Server forwarder_;
};

/// Does its steps, each when the server has answered the one before.
class RoomClient {
 public:
  explicit RoomClient(vrpn_Connection* connection)
      : connection_(connection),
        speaker_("Room Client", connection),
        number_("number"),
        length_("length", 0, VRPN_SO_IGNORE_OLD | VRPN_SO_IGNORE_IDEMPOTENT),
        text_("text"),
        redundant_(connection),
        receiver_(connection),
        lock_("Lock", connection),
        logger_("Logger", connection),
        poser_("Poser", connection),
        output_("Output", connection),
        files_(connection),
        forwards_(connection) {
    length_.set(0.5, roomTime(1));
    number_.register_handler(roomNumber, &speaker_);
    length_.register_handler(roomLength, &speaker_);
    text_.register_handler(roomText, &speaker_);
    number_.bindConnection(connection);
    length_.bindConnection(connection);
    text_.bindConnection(connection);
    lock_.addRequestGrantedCallback(&speaker_, onGranted);
    lock_.addRequestDeniedCallback(&speaker_, onDenied);
    lock_.addTakeCallback(&speaker_, onTaken);
    lock_.addReleaseCallback(&speaker_, onReleased);
    logger_.register_report_handler(this, onLog);
    receiver_.register_handler(connection->register_message_type("Room Sign"), onSign, this,
                               connection->register_sender("Room Server"));
    connection->register_handler(connection->register_message_type("Room Step"), onStep, this,
                                 connection->register_sender("Room Server"));
  }
  ~RoomClient() {
    connection_->unregister_handler(connection_->register_message_type("Room Step"), onStep, this,
                                    connection_->register_sender("Room Server"));
  }
  void begin() { act(1); }
  /// The last step waits until another client listens to what is forwarded.
  bool waits() const { return done_ == kRoomSteps - 1; }
  void finish() { act(kRoomSteps); }
  bool done() const { return done_ == kRoomSteps; }
  void mainloop() { connection_->mainloop(); }

 private:
  static int VRPN_CALLBACK onStep(void* self, vrpn_HANDLERPARAM p) {
    RoomClient* client = static_cast<RoomClient*>(self);
    client->done_ = p.buffer[0];
    if (client->done_ + 1 < kRoomSteps) client->act(static_cast<char>(client->done_ + 1));
    return 0;
  }
  static int onGranted(void* speaker) { return told(speaker, "granted"); }
  static int onDenied(void* speaker) { return told(speaker, "denied"); }
  static int onTaken(void* speaker) { return told(speaker, "taken"); }
  static int onReleased(void* speaker) { return told(speaker, "released"); }
  static int told(void* speaker, const char* text) {
    static_cast<RoomSpeaker*>(speaker)->say(text);
    return 0;
  }
  void sayLock() {
    speaker_.say(lock_.isAvailable()     ? "lock is free"
                 : lock_.isHeldLocally() ? "lock is held here"
                                         : "lock is held there");
  }
  static int VRPN_CALLBACK onSign(void* self, vrpn_HANDLERPARAM p) {
    const char text[] = {p.buffer[0], 0};
    static_cast<RoomClient*>(self)->speaker_.say(text);
    return 0;
  }
  static void VRPN_CALLBACK onLog(void* self, const vrpn_AUXLOGGERCB report) {
    char text[200];
    snprintf(text, sizeof text, "logs %s,%s,%s,%s", named(report.local_in_logfile_name),
             named(report.local_out_logfile_name), named(report.remote_in_logfile_name),
             named(report.remote_out_logfile_name));
    static_cast<RoomClient*>(self)->speaker_.say(text);
  }

  void act(char number) {
    const vrpn_float64 position[3] = {0.25, -0.5, 2};
    const vrpn_float64 quaternion[4] = {0, 0.6, 0, 0.8};
    vrpn_float64 values[3] = {1, -2, 0.125};
    struct timeval interval;
    interval.tv_sec = 2;
    interval.tv_usec = 1500;
    switch (number) {
      case 1:
        number_.set(-7, roomTime(12));
        length_.set(1.25, roomTime(12));
        text_.set("a text of the client, which is longer", roomTime(12));
        break;
      case 2:
        number_.becomeSerializer();
        length_.becomeSerializer();
        break;
      case 3:
        speaker_.say("serializer", number_.isSerializer() ? 1 : 0, length_.isSerializer() != 0);
        length_.set(-1, roomTime(40));
        length_.set(-2, roomTime(35));
        redundant_.set(2, interval);
        redundant_.enable(vrpn_true);
        // VRPN's remote says both under a wrong type, so its controller does not hear it.
        send("vrpn Redundant Transmission Controller", "vrpn_Red_Xmit_Ctrl set",
             std::string("\0\0\0\2\0\0\0\2\0\0\5\xdc\0\0\0\0\0\0\0\0", 20));
        send("vrpn Redundant Transmission Controller", "vrpn_Red_Xmit_Ctrl enable", std::string("\0\1", 2));
        break;
      case 4:
        logger_.send_logging_request("a", "bc", "", "def");
        logger_.send_logging_status_request();
        // Two more that want the lock, written out; the remote was the first.
        send("Lock", "vrpn_Mutex Request Index", std::string("\0\0\0\7\0\0\1\2", 8));
        send("Lock", "vrpn_Mutex Request Index", std::string("\0\0\0\6\0\0\1\3", 8));
        send("Lock", "vrpn_Mutex Request Mutex", std::string("\0\0\0\2", 4));
        send("Lock", "vrpn_Mutex Request Mutex", std::string("\0\0\0\1", 4));
        break;
      case 5:
        sayLock();
        lock_.request();
        send("Lock", "vrpn_Mutex Release", "");
        speaker_.say("pose", poser_.request_pose(roomTime(50), position, quaternion), true);
        speaker_.say("relative", poser_.request_pose_relative(roomTime(50), position, quaternion), true);
        speaker_.say("velocity", poser_.request_pose_velocity(roomTime(50), position, quaternion, 0.5), true);
        speaker_.say("relative velocity",
                     poser_.request_pose_velocity_relative(roomTime(50), position, quaternion, 0.25), true);
        speaker_.say("output", output_.request_change_channel_value(2, 0.75) ? 1 : 0, true);
        speaker_.say("outputs", output_.request_change_channels(3, values) ? 1 : 0, true);
        break;
      case 6:
        sayLock();
        lock_.request();
        send("Lock", "vrpn_Mutex Request Mutex", std::string("\0\0\0\1", 4));
        files_.set_replay_rate(2.5F);
        files_.reset();
        files_.play_to_time(interval);
        speaker_.say("forwards", forwards_.start_remote_forwarding(kForwardedPort) ? 1 : 0, true);
        forwards_.forward_message_type(kForwardedPort, "Room Server", "Room Sign");
        redundant_.enable(vrpn_false);
        break;
      default:
        sayLock();
        lock_.release();
        sayLock();
    }
    speaker_.step(number);
  }
  void send(const char* sender, const char* type, const std::string& payload) {
    connection_->pack_message(static_cast<vrpn_uint32>(payload.size()), roomTime(1),
                              connection_->register_message_type(type), connection_->register_sender(sender),
                              payload.data(), vrpn_CONNECTION_RELIABLE);
  }

  vrpn_Connection* connection_;
  RoomSpeaker speaker_;
  vrpn_Shared_int32_Remote number_;
  vrpn_Shared_float64_Remote length_;
  vrpn_Shared_String_Remote text_;
  vrpn_RedundantRemote redundant_;
  vrpn_RedundantReceiver receiver_;
  vrpn_Mutex_Remote lock_;
  vrpn_Auxiliary_Logger_Remote logger_;
  vrpn_Poser_Remote poser_;
  vrpn_Analog_Output_Remote output_;
  vrpn_File_Controller files_;
  vrpn_Forwarder_Controller forwards_;
  int done_ = 0;
};
