// Datagrams that are sent several times, and a receiver that takes each once.
#ifndef VRPN_REDUNDANT_TRANSMISSION_H
#define VRPN_REDUNDANT_TRANSMISSION_H

#include <cstdio>
#include <list>
#include <map>
#include <utility>
#include <vector>

#include "vrpn_BaseClass.h"
#include "vrpn_Connection.h"
#include "vrpn_Shared.h"

/// Repeats messages by datagram while it is enabled; otherwise sends them once, as they are.
class vrpn_RedundantTransmission {
 public:
  explicit vrpn_RedundantTransmission(vrpn_Connection* connection) : connection_(connection) {
    if (connection_ != NULL) connection_->addReference();
  }
  virtual ~vrpn_RedundantTransmission() {
    if (connection_ != NULL) connection_->removeReference();
  }
  vrpn_RedundantTransmission(const vrpn_RedundantTransmission&) = delete;
  vrpn_RedundantTransmission& operator=(const vrpn_RedundantTransmission&) = delete;

  vrpn_uint32 defaultRetransmissions() const { return repeats_; }
  struct timeval defaultInterval() const {
    return interval_;
  }
  vrpn_bool isEnabled() const { return enabled_; }
  void enable(vrpn_bool on) { enabled_ = on != 0; }
  virtual void setDefaults(vrpn_uint32 repeats, struct timeval interval) {
    repeats_ = repeats;
    interval_ = interval;
  }

  /// Sends the repetitions that are due.
  virtual void mainloop() {
    struct timeval now;
    vrpn_gettimeofday(&now);
    for (std::list<Message>::iterator m = messages_.begin(); m != messages_.end();) {
      if (vrpn_TimevalGreater(now, m->due)) {
        send(*m);
        m->due = vrpn_TimevalSum(now, m->interval);
        --m->left;
      }
      if (m->left == 0) {
        m = messages_.erase(m);
      } else {
        ++m;
      }
    }
  }

  /// `repeats` in addition to the first time; negative and NULL take the defaults.
  virtual int pack_message(vrpn_uint32 len, struct timeval time, vrpn_uint32 type, vrpn_uint32 sender,
                           const char* buffer, vrpn_uint32 class_of_service, vrpn_int32 repeats = -1,
                           struct timeval* interval = NULL) {
    if (connection_ == NULL) return -1;
    Message message = {static_cast<vrpn_int32>(type),
                       static_cast<vrpn_int32>(sender),
                       time,
                       std::vector<char>(buffer, buffer + len),
                       repeats < 0 ? repeats_ : static_cast<vrpn_uint32>(repeats),
                       interval != NULL ? *interval : interval_,
                       time};
    if (!enabled_) {
      return connection_->pack_message(len, time, message.type, message.sender, buffer, class_of_service);
    }
    const int result = send(message);
    if (message.interval.tv_sec == 0 && message.interval.tv_usec == 0) {
      // Datagrams of their own, so that one loss does not take all.
      for (; message.left > 0; --message.left) {
        connection_->send_pending_reports();
        send(message);
      }
      connection_->send_pending_reports();
    }
    if (message.left == 0) return result;
    struct timeval now;
    vrpn_gettimeofday(&now);
    message.due = vrpn_TimevalSum(now, message.interval);
    messages_.push_back(message);
    return result;
  }

 private:
  struct Message {
    vrpn_int32 type, sender;
    struct timeval time;
    std::vector<char> payload;
    vrpn_uint32 left;
    struct timeval interval, due;
  };
  int send(const Message& m) {
    return connection_->pack_message(static_cast<vrpn_uint32>(m.payload.size()), m.time, m.type, m.sender,
                                     m.payload.data(), vrpn_CONNECTION_LOW_LATENCY);
  }

  vrpn_Connection* connection_;
  std::list<Message> messages_;
  vrpn_uint32 repeats_ = 0;
  struct timeval interval_ = {};
  bool enabled_ = false;
};

/// Lets a vrpn_RedundantRemote at the other end set the defaults of a transmission.
class vrpn_RedundantController : public vrpn_BaseClass {
 public:
  vrpn_RedundantController(vrpn_RedundantTransmission* transmission, vrpn_Connection* connection)
      : vrpn_BaseClass("vrpn Redundant Transmission Controller", connection), transmission_(transmission) {
    init();
    listen("vrpn_Red_Xmit_Ctrl set", onSet, this);
    listen("vrpn_Red_Xmit_Ctrl enable", onEnable, this);
  }
  virtual void mainloop() { server_mainloop(); }

 private:
  static int VRPN_CALLBACK onSet(void* self, vrpn_HANDLERPARAM p) {
    if (p.payload_len < 12) return 0;
    vrpn_uint32 repeats = 0;
    struct timeval interval = {};
    vrpn_unbuffer(&p.buffer, &repeats);
    vrpn_unbuffer(&p.buffer, &interval);
    static_cast<vrpn_RedundantController*>(self)->transmission_->setDefaults(repeats, interval);
    return 0;
  }
  static int VRPN_CALLBACK onEnable(void* self, vrpn_HANDLERPARAM p) {
    if (p.payload_len < 2) return 0;
    vrpn_bool on = 0;
    vrpn_unbuffer(&p.buffer, &on);
    static_cast<vrpn_RedundantController*>(self)->transmission_->enable(on);
    return 0;
  }

  vrpn_RedundantTransmission* transmission_;
};

/// Sets the defaults of the transmission behind a vrpn_RedundantController at the other end.
class vrpn_RedundantRemote : public vrpn_BaseClass {
 public:
  explicit vrpn_RedundantRemote(vrpn_Connection* connection)
      : vrpn_BaseClass("vrpn Redundant Transmission Controller", connection) {
    init();
  }
  virtual void mainloop() { client_mainloop(); }

  void set(int repeats, struct timeval interval) {
    // VRPN's sends the size of its structure: 8 bytes of time, then 8 that nobody reads.
    char payload[20] = {};
    char* at = payload;
    vrpn_int32 left = sizeof(payload);
    vrpn_buffer(&at, &left, static_cast<vrpn_uint32>(repeats));
    vrpn_buffer(&at, &left, interval);
    send("vrpn_Red_Xmit_Ctrl set", payload, sizeof(payload));
  }
  void enable(vrpn_bool on) {
    char payload[2];
    char* at = payload;
    vrpn_int32 left = sizeof(payload);
    vrpn_buffer(&at, &left, on);
    send("vrpn_Red_Xmit_Ctrl enable", payload, sizeof(payload));
  }

 private:
  void send(const char* type, const char* payload, vrpn_uint32 length) {
    if (d_connection == NULL) return;
    struct timeval now;
    vrpn_gettimeofday(&now, NULL);
    d_connection->pack_message(length, now, d_connection->register_message_type(type), d_sender_id, payload,
                               vrpn_CONNECTION_RELIABLE);
  }
};

/// Calls each handler once for messages that arrive several times. It knows a repetition by its stamp.
class vrpn_RedundantReceiver {
 public:
  explicit vrpn_RedundantReceiver(vrpn_Connection* connection) : connection_(connection) {
    if (connection_ != NULL) connection_->addReference();
  }
  virtual ~vrpn_RedundantReceiver() {
    if (connection_ == NULL) return;
    for (std::list<Handler>::iterator h = handlers_.begin(); h != handlers_.end(); ++h)
      connection_->unregister_handler(h->type, received, &*h, h->sender);
    connection_->removeReference();
  }
  vrpn_RedundantReceiver(const vrpn_RedundantReceiver&) = delete;
  vrpn_RedundantReceiver& operator=(const vrpn_RedundantReceiver&) = delete;

  virtual int register_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                               vrpn_int32 sender = vrpn_ANY_SENDER) {
    if (connection_ == NULL || handler == NULL) return -1;
    Handler entry = {this, type, sender, handler, userdata, {}};
    handlers_.push_back(entry);
    return connection_->register_handler(type, received, &handlers_.back(), sender);
  }
  virtual int unregister_handler(vrpn_int32 type, vrpn_MESSAGEHANDLER handler, void* userdata,
                                 vrpn_int32 sender = vrpn_ANY_SENDER) {
    for (std::list<Handler>::iterator h = handlers_.begin(); h != handlers_.end(); ++h) {
      if (h->type != type || h->sender != sender || h->handler != handler || h->userdata != userdata)
        continue;
      connection_->unregister_handler(type, received, &*h, sender);
      handlers_.erase(h);
      return 0;
    }
    return -1;
  }

  /// Whether to count how often each message arrives.
  void record(vrpn_bool on) { record_ = on != 0; }
  /// Writes a line of time stamp and number for each message that was counted.
  void writeMemory(const char* filename) {
    FILE* const file = fopen(filename, "wb");
    if (file == NULL) {
      fprintf(stderr, "VRPN: cannot write %s\n", filename);
      return;
    }
    for (size_t i = 0; i < memory_.size(); ++i) {
      fprintf(file, "%ld.%ld %d\n", static_cast<long>(memory_[i].first.tv_sec),
              static_cast<long>(memory_[i].first.tv_usec), memory_[i].second);
    }
    fclose(file);
  }
  void clearMemory() { memory_.clear(); }

 private:
  typedef std::pair<vrpn_int32, vrpn_int32> Source;  // type and sender
  struct Handler {
    vrpn_RedundantReceiver* receiver;
    vrpn_int32 type, sender;
    vrpn_MESSAGEHANDLER handler;
    void* userdata;
    std::map<Source, std::vector<struct timeval>> seen;  // the last stamps
  };

  static int VRPN_CALLBACK received(void* self, vrpn_HANDLERPARAM p) {
    const size_t remembered = 8;
    Handler& entry = *static_cast<Handler*>(self);
    std::vector<struct timeval>& seen = entry.seen[Source(p.type, p.sender)];
    for (size_t i = 0; i < seen.size(); ++i) {
      if (!vrpn_TimevalEqual(seen[i], p.msg_time)) continue;
      entry.receiver->count(p.msg_time);
      return 0;
    }
    if (entry.receiver->record_) entry.receiver->memory_.push_back(std::make_pair(p.msg_time, 1));
    if (seen.size() == remembered) seen.erase(seen.begin());
    seen.push_back(p.msg_time);
    return entry.handler(entry.userdata, p);
  }

  void count(const struct timeval& stamp) {
    for (size_t i = memory_.size(); i-- > 0;) {
      if (!vrpn_TimevalEqual(memory_[i].first, stamp)) continue;
      ++memory_[i].second;
      return;
    }
  }

  vrpn_Connection* connection_;
  std::list<Handler> handlers_;
  bool record_ = false;
  std::vector<std::pair<struct timeval, int>> memory_;
};

#endif
