// One side of one connection, as a state machine without a socket: bytes in, events out; messages in, bytes
// out. Server and client use the same class. Handshake: our cookie is in the stream from the start; when the
// peer's has come, our descriptions follow it and Connected is reported. Messages before that are not sent.
//
// Names a peer describes that we do not know are kept as names and not announced back: the stock library
// maps only what its peer described to what it registered itself, so nothing there depends on the echo.
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "wire/frame_encoder.h"
#include "wire/names.h"
#include "wire/system.h"

namespace hapticd::wire {

// Events. Views in them are valid until the sink returns.

/// The peer's cookie is valid; messages can be sent from now on.
struct Connected {
  std::string_view version;  ///< the peer's, such as "07.34"
  int log_mode = 0;          ///< logging the peer asks of us, see Cookie
};
struct SenderDescribed {
  RemoteSender id;
  std::string_view name;
};
struct TypeDescribed {
  RemoteType id;
  std::string_view name;
  MessageKind kind = kUnknownKind;  ///< kUnknownKind when the table has no such message
};
/// A message, not decoded yet: decode<M>(payload) when the kind is known to be M, or decode(kind, payload).
struct MessageReceived {
  MessageKind kind = kUnknownKind;
  RemoteType type;
  RemoteSender sender;
  LocalSender local_sender;  ///< our sender of the same name; value -1 when there is none
  std::string_view typeName;
  std::string_view senderName;
  Time time;
  ByteView payload;
};
/// The peer listens for datagrams here: be ready to send to it, then call useDatagrams(). Stock peers send
/// theirs from another port, so a socket that is connected to this address receives nothing from them.
struct UdpDescribed {
  UdpAddress address;
};
/// The peer asks for log files. Whether to open files that a peer names is the caller's decision; the stock
/// server does.
struct LogRequested {
  LogRequest request;
};
/// Something was ignored; the connection continues.
struct Ignored {
  std::string_view reason;  ///< a string literal
  std::int32_t value = 0;   ///< the offending number
};
/// The peer violated the protocol: close the connection. No event follows, and nothing more is sent.
struct ProtocolError {
  std::string_view reason;
};

using Event = std::variant<MessageReceived, Connected, SenderDescribed, TypeDescribed, UdpDescribed,
                           LogRequested, Ignored, ProtocolError>;

/// What differs between peers of one process.
struct PeerOptions {
  /// Our own datagram socket, described to the peer. Without one the connection is TCP only, as a `tcp://`
  /// connection is on both sides, and a peer's UDP description is ignored.
  std::optional<UdpAddress> udp;
  /// Logging asked of the peer.
  std::optional<LogRequest> log;
};

/// The state machine. Pure: no clock, no socket, no thread; one thread at a time. The sink of a feed may
/// send, and must neither feed nor destroy the peer.
class Peer {
 public:
  /// The names must outlive the peer, which also announces names added later.
  explicit Peer(const LocalNames& names, PeerOptions options = {});

  /// Takes bytes of the TCP stream, cut anywhere, and calls sink(const Event&) for each event in them. `now`
  /// stamps the descriptions this may send. Keeps at most one unfinished frame.
  template <class Sink>
  void feed(Time now, ByteView bytes, Sink&& sink) {
    feedStream(now, bytes, EventSink(sink));
  }
  /// Takes one datagram. Errors in it are Ignored, never a ProtocolError, because datagrams can be
  /// forged; for the same reason system messages in it are ignored.
  template <class Sink>
  void feedDatagram(ByteView datagram, Sink&& sink) {
    feedPacket(datagram, EventSink(sink));
  }

  /// Whether the handshake is complete and no ProtocolError followed.
  bool connected() const noexcept { return state_ == State::kConnected; }
  /// Whether a ProtocolError was reported.
  bool failed() const noexcept { return state_ == State::kFailed; }

  /// From now on low-latency messages leave as datagrams, or everything by TCP, as at first.
  void useDatagrams(bool use = true) noexcept { useDatagrams_ = use; }
  bool usesDatagrams() const noexcept { return useDatagrams_; }

  /// Memory that the names take which the peer described.
  std::size_t namesBytes() const noexcept { return namesBytes_; }

  /// Sends a message; false, and nothing happens, when not connected. std::length_error as FrameEncoder::add.
  template <WireMessage M>
  bool send(Time time, LocalSender sender, const M& message, Reliability reliability = M::kInfo.reliability) {
    if (!announce(time)) return false;
    route(reliability, kHeaderBytes + payloadSize(message)).add(time, sender, message);
    return true;
  }
  bool send(Time time, LocalSender sender, const Message& message) {
    return send(time, sender, message, info(message.kind()).reliability);
  }
  bool send(Time time, LocalSender sender, const Message& message, Reliability reliability);
  /// Sends a message of a type that is not in the table, see LocalNames::addType.
  bool sendRaw(Time time, LocalSender sender, LocalType type, ByteView payload, Reliability reliability);
  /// Sends whole frames of a FrameEncoder, shared with other peers; false when not connected.
  bool sendFrames(Time now, ByteView frames, Reliability reliability);
  /// Describes names added since the last feed or send; false when not connected.
  bool announce(Time now);

  /// Moves the bytes to be written to the TCP stream into out, replacing what was there.
  void takeStream(std::vector<std::byte>& out) noexcept { stream_.swapOut(out); }
  /// Calls sink(ByteView) for each datagram to be sent, and forgets them.
  template <class Sink>
  void takeDatagrams(Sink&& sink) {
    cutDatagrams(datagrams_.bytes(), sink);
    datagrams_.clear();
  }

 private:
  enum class State : std::uint8_t { kAwaitingCookie, kConnected, kFailed };

  // A reference to the caller's sink: one indirect call per event, no allocation.
  class EventSink {
   public:
    template <class Sink>
    explicit EventSink(Sink& sink)
        : sink_(const_cast<void*>(static_cast<const void*>(std::addressof(sink)))),
          call_([](void* s, const Event& event) { (*static_cast<Sink*>(s))(event); }) {}
    void operator()(const Event& event) const { call_(sink_, event); }

   private:
    void* sink_;
    void (*call_)(void*, const Event&);
  };

  struct SenderEntry {
    std::string name;
    LocalSender local;
    bool described = false;
  };
  struct TypeEntry {
    std::string name;
    MessageKind kind = kUnknownKind;
    bool described = false;
  };

  void feedStream(Time now, ByteView bytes, EventSink sink);
  void feedPacket(ByteView datagram, EventSink sink);
  std::size_t unitBytes(ByteView start) const noexcept;
  void handleUnit(Time now, ByteView bytes, EventSink sink);
  void handleCookie(Time now, ByteView bytes, EventSink sink);
  void handleSystem(const FrameView& frame, EventSink sink);
  void handleDescription(const FrameView& frame, EventSink sink);
  void handleMessage(const FrameView& frame, EventSink sink) const;
  void fail(const std::string& reason, EventSink sink);
  FrameEncoder& route(Reliability reliability, std::size_t frame_bytes) noexcept;

  const LocalNames* names_;
  PeerOptions options_;
  State state_ = State::kAwaitingCookie;
  bool useDatagrams_ = false;
  std::size_t announcedSenders_ = 0;
  std::size_t announcedTypes_ = 0;
  std::vector<std::byte> partial_;    // the start of a cookie or frame that is still incomplete
  std::vector<SenderEntry> senders_;  // by the peer's number
  std::vector<TypeEntry> types_;
  std::size_t namesBytes_ = 0;
  FrameEncoder stream_;
  FrameEncoder datagrams_;
};

}  // namespace hapticd::wire
