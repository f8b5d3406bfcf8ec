#include "hapticd/vrpn/vrpn_FileConnection.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>

#include "base/world.h"
#include "wire/bytes.h"
#include "wire/cookie.h"
#include "wire/system.h"

namespace wire = hapticd::wire;

bool vrpn_FILE_CONNECTIONS_SHOULD_PRELOAD = true;
bool vrpn_FILE_CONNECTIONS_SHOULD_ACCUMULATE = true;
bool vrpn_FILE_CONNECTIONS_SHOULD_SKIP_TO_USER_MESSAGES = true;

namespace {

constexpr std::size_t kHead_bytes = 24;  // type, sender, seconds, microseconds, length, a number to ignore

timeval fromSeconds(double seconds) {
  return vrpn_MsecsTimeval(seconds * 1000);
}

}  // namespace

vrpn_File_Connection::vrpn_File_Connection(const char* name, const char*, const char*)
    : vrpn_Connection(nullptr, -1) {
  const std::unique_ptr<char[]> path(vrpn_copy_file_name(name));
  file_ = path ? path.get() : name;
  ok_ = read();
  reset();
}

vrpn_File_Connection::~vrpn_File_Connection() = default;

bool vrpn_File_Connection::read() {
  std::vector<std::byte> bytes;
  try {
    bytes = hapticd::base::world().files.read(file_);
  } catch (const std::exception& error) {
    fprintf(stderr, "VRPN: %s\n", error.what());
    return false;
  }
  wire::ByteView rest(bytes);
  if (rest.size() < wire::kCookieBytes || !wire::decodeCookie(rest.first(wire::kCookieBytes))) {
    fprintf(stderr, "VRPN: %s is not a log file of VRPN\n", file_.c_str());
    return false;
  }
  rest = rest.subspan(wire::kCookieBytes);
  std::map<vrpn_int32, vrpn_int32> senders;  // by their numbers in the file
  std::map<vrpn_int32, vrpn_int32> types;
  while (rest.size() >= kHead_bytes) {
    const auto number = [&](std::size_t i) { return wire::loadBig<std::int32_t>(rest.data() + 4 * i); };
    const vrpn_int32 type = number(0);
    const vrpn_int32 sender = number(1);
    const timeval time = {number(2), number(3)};
    const auto length = static_cast<std::size_t>(number(4));
    if (length > rest.size() - kHead_bytes) break;
    const char* payload = reinterpret_cast<const char*>(rest.data() + kHead_bytes);
    rest = rest.subspan(kHead_bytes + length);
    if (type == vrpn_CONNECTION_SENDER_DESCRIPTION || type == vrpn_CONNECTION_TYPE_DESCRIPTION) {
      if (length <= sizeof(vrpn_int32)) continue;
      const std::string name(payload + sizeof(vrpn_int32),
                             strnlen(payload + sizeof(vrpn_int32), length - sizeof(vrpn_int32)));
      if (type == vrpn_CONNECTION_SENDER_DESCRIPTION) {
        senders[sender] = register_sender(name.c_str());
      } else {
        types[sender] = register_message_type(name.c_str());
      }
    } else if (senders.count(sender) != 0 && types.count(type) != 0) {
      entries_.push_back({time, types[type], senders[sender], {payload, payload + length}});
    }
  }
  if (!rest.empty()) {
    fprintf(stderr, "VRPN: %s is damaged: %zu bytes at its end are left out\n", file_.c_str(), rest.size());
  }
  return true;
}

int vrpn_File_Connection::mainloop(const timeval* timeout) {
  if (!ok_) return -1;
  if (timeout) vrpn_SleepMsecs(vrpn_TimevalMsecs(*timeout));
  const timeval now = vrpn_Connection::get_time();
  if (lastPlayed_.tv_sec == 0) lastPlayed_ = now;
  const timeval passed = vrpn_TimevalDiff(now, lastPlayed_);
  lastPlayed_ = now;
  const double due_us = 1000 * vrpn_TimevalMsecs(passed) * static_cast<double>(rate_) + rest_us_;
  const double whole_us = std::floor(due_us);
  rest_us_ = static_cast<float>(due_us - whole_us);
  const timeval until = vrpn_TimevalSum(position_, vrpn_MsecsTimeval(whole_us / 1000));
  for (vrpn_uint32 played = 0; playone_to_filetime(until) == 0;) {
    if (++played == most_) return 0;
  }
  position_ = until;
  return 0;
}

void vrpn_File_Connection::play(const Entry& entry) {
  callHandlers({entry.type, entry.sender, entry.time, static_cast<vrpn_int32>(entry.payload.size()),
                entry.payload.data()});
}

int vrpn_File_Connection::playone() {
  if (eof() != 0) return -1;
  const Entry& entry = entries_[next_++];
  if (vrpn_TimevalGreater(entry.time, position_)) position_ = entry.time;
  play(entry);
  return 0;
}

int vrpn_File_Connection::playone_to_filetime(timeval filetime) {
  if (eof() != 0 || vrpn_TimevalGreater(entries_[next_].time, filetime)) return 1;
  return playone();
}

int vrpn_File_Connection::play_to_filetime(const timeval filetime) {
  if (vrpn_TimevalGreater(position_, filetime)) reset();
  while (playone_to_filetime(filetime) == 0) {
  }
  position_ = filetime;
  lastPlayed_ = vrpn_Connection::get_time();
  return 0;
}

int vrpn_File_Connection::play_to_time(timeval time) {
  return play_to_filetime(vrpn_TimevalSum(get_lowest_user_timestamp(), time));
}
int vrpn_File_Connection::play_to_time(vrpn_float64 seconds) {
  return play_to_time(fromSeconds(seconds));
}

int vrpn_File_Connection::jump_to_filetime(timeval filetime) {
  const auto later = [&](const Entry& entry) { return !vrpn_TimevalGreater(filetime, entry.time); };
  next_ = static_cast<std::size_t>(std::find_if(entries_.begin(), entries_.end(), later) - entries_.begin());
  position_ = filetime;
  lastPlayed_ = {};
  return eof() == 0 ? 1 : 0;
}
int vrpn_File_Connection::jump_to_time(timeval time) {
  return jump_to_filetime(vrpn_TimevalSum(get_lowest_user_timestamp(), time));
}
int vrpn_File_Connection::jump_to_time(vrpn_float64 seconds) {
  return jump_to_time(fromSeconds(seconds));
}

void vrpn_File_Connection::set_replay_rate(vrpn_float32 rate) {
  rate_ = std::fmin(std::fmax(rate, 0.0F), std::numeric_limits<float>::max());
}

int vrpn_File_Connection::reset() {
  next_ = 0;
  position_ = get_lowest_user_timestamp();
  lastPlayed_ = {};
  return 0;
}

int vrpn_File_Connection::time_since_connection_open(timeval* elapsed) {
  *elapsed = vrpn_TimevalDiff(position_, get_lowest_user_timestamp());
  return 0;
}

timeval vrpn_File_Connection::get_lowest_user_timestamp() const {
  timeval lowest = {};
  for (const Entry& entry : entries_) {
    if (lowest.tv_sec == 0 || vrpn_TimevalGreater(lowest, entry.time)) lowest = entry.time;
  }
  return lowest;
}

timeval vrpn_File_Connection::get_highest_user_timestamp() const {
  timeval highest = {};
  for (const Entry& entry : entries_) {
    if (vrpn_TimevalGreater(entry.time, highest)) highest = entry.time;
  }
  return highest;
}

timeval vrpn_File_Connection::get_length() const {
  return vrpn_TimevalDiff(get_highest_user_timestamp(), get_lowest_user_timestamp());
}
