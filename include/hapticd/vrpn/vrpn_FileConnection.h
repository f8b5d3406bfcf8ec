// Log files of VRPN as connections: NAME@file:path. hapticd writes them by `hapticd export` and `hapticd
// record`.
#ifndef VRPN_FILE_CONNECTION_H
#define VRPN_FILE_CONNECTION_H

#include <string>
#include <vector>

#include "vrpn_Connection.h"

/// VRPN's switches. They change nothing here: a file is read whole when it is opened.
extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_PRELOAD;
extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_ACCUMULATE;
extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_SKIP_TO_USER_MESSAGES;

/// Plays the messages of a file at the rate at which they were recorded. Times in seconds or timeval count
/// from the first message; a filetime is a stamp in the file.
class VRPN_API vrpn_File_Connection : public vrpn_Connection {
 public:
  /// Prints an error, and doing_okay() is false, when the file cannot be read. A damaged end is left out.
  explicit vrpn_File_Connection(const char* name, const char* local_in_logfile = NULL,
                                const char* local_out_logfile = NULL);
  virtual ~vrpn_File_Connection();

  virtual vrpn_bool doing_okay() const { return ok_; }
  virtual vrpn_bool connected() const { return ok_; }
  /// Plays what is due since the last call.
  virtual int mainloop(const struct timeval* timeout = NULL);
  /// The position in the file.
  virtual int time_since_connection_open(struct timeval* elapsed);
  /// The same as a filetime.
  virtual struct timeval get_time() { return position_; }
  virtual vrpn_File_Connection* get_File_Connection() { return this; }

  /// 0 pauses; negative rates are taken for 0.
  void set_replay_rate(vrpn_float32 rate);
  vrpn_float32 get_replay_rate() const { return rate_; }
  /// Back to the first message.
  int reset();
  /// 1 when all messages were played.
  int eof() const { return next_ == entries_.size(); }
  /// Plays all messages up to then, those of earlier ones from the start when it lies before the position.
  int play_to_time(vrpn_float64 seconds);
  int play_to_time(struct timeval time);
  int play_to_filetime(const struct timeval filetime);
  /// Plays one message: 0, or -1 at the end.
  int playone();
  /// The same: 1 at the end or when the next one is later than `filetime`.
  int playone_to_filetime(struct timeval filetime);
  /// Continues there without playing what lies between: 1, or 0 when all messages are earlier.
  int jump_to_time(vrpn_float64 seconds);
  int jump_to_time(struct timeval time);
  int jump_to_filetime(struct timeval filetime);
  struct timeval get_length() const;
  double get_length_secs() const { return vrpn_TimevalMsecs(get_length()) / 1000; }
  struct timeval get_lowest_user_timestamp() const;
  struct timeval get_highest_user_timestamp() const;
  const char* get_filename() const { return file_.c_str(); }
  /// Messages that one mainloop() plays at most; 0: all that are due.
  void limit_messages_played_back(vrpn_uint32 most) { most_ = most; }

 private:
  struct Entry {
    struct timeval time;
    vrpn_int32 type, sender;
    std::vector<char> payload;
  };
  bool read();
  void play(const Entry& entry);

  std::string file_;
  bool ok_ = false;
  vrpn_float32 rest_us_ = 0;  // that is due beyond the position
  std::vector<Entry> entries_;
  size_t next_ = 0;
  struct timeval position_ = {};    // filetime
  struct timeval lastPlayed_ = {};  // wall time of the last mainloop(); 0 before it
  vrpn_float32 rate_ = 1;
  vrpn_uint32 most_ = 0;
};

#endif
