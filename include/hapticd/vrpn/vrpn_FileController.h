// Controls the playback of a log file, here or in the server at the other end of a connection.
#ifndef VRPN_FILE_CONTROLLER_H
#define VRPN_FILE_CONTROLLER_H

#include "vrpn_Connection.h"
#include "vrpn_FileConnection.h"

/// Acts on a vrpn_File_Connection directly; to any other connection it sends what a server that plays a file
/// understands. The connection must outlive it.
class vrpn_File_Controller {
 public:
  explicit vrpn_File_Controller(vrpn_Connection* connection)
      : connection_(connection), file_(connection != NULL ? connection->get_File_Connection() : NULL) {
    if (connection_ != NULL) sender_ = connection_->register_sender("vrpn File Controller");
  }

  void set_replay_rate(vrpn_float32 rate = 1.0F) {
    if (file_ != NULL) {
      file_->set_replay_rate(rate);
      return;
    }
    char payload[sizeof(vrpn_float32)];
    char* at = payload;
    vrpn_int32 left = sizeof(payload);
    vrpn_buffer(&at, &left, rate);
    send("vrpn_File set_replay_rate", payload, sizeof(payload));
  }
  /// Back to the first message, at the same rate.
  void reset() {
    if (file_ != NULL) {
      file_->reset();
    } else {
      send("vrpn_File reset", NULL, 0);
    }
  }
  /// Plays all messages up to this time after the first one.
  void play_to_time(struct timeval time) {
    if (file_ != NULL) {
      file_->play_to_time(time);
    } else {
      // VRPN sends the memory of the structure.
      send("vrpn_File play_to_time", reinterpret_cast<const char*>(&time), sizeof(time));
    }
  }

 private:
  void send(const char* type, const char* payload, vrpn_uint32 length) {
    if (connection_ == NULL) return;
    struct timeval now;
    vrpn_gettimeofday(&now, NULL);
    connection_->pack_message(length, now, connection_->register_message_type(type), sender_, payload,
                              vrpn_CONNECTION_RELIABLE);
  }

  vrpn_Connection* connection_;
  vrpn_File_Connection* file_;
  vrpn_int32 sender_ = -1;
};

#endif
