// Limits the rate of notices: repeated ones are counted.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/notice.h"

namespace hapticd::scene {

using base::Nanos;

/// Lets the first few notices of a kind through, then one in a second that counts the others.
class NoticeBoard {
 public:
  /// Notices of one `kind` are counted together, for example the call and the reason.
  void post(Notice notice, std::string kind, Nanos now, std::vector<Notice>& out);
  /// Appends the counts that are due.
  void flush(Nanos now, std::vector<Notice>& out);
  std::optional<Nanos> nextDeadline() const;
  /// The client left: drops its notices.
  void forget(ClientId client);

 private:
  struct Entry {
    Nanos windowEnd = 0;
    int shown = 0;
    std::uint64_t held = 0;
    Notice last;
  };
  std::map<std::pair<ClientId, std::string>, Entry> entries_;
};

/// The context of one command: its client, its time, and where notices go.
struct Call {
  ClientId client = 0;
  Nanos now = 0;
  bool inBatch = false;
  NoticeBoard& board;
  std::vector<Notice>& out;

  /// Says that something was ignored or done differently. `name` is the client's call.
  template <class... Parts>
  void warn(std::string_view name, std::string_view reason, const Parts&... parts) const {
    send(Notice::Severity::warning, name, reason, parts...);
  }
  /// Says that the command was refused and the scene is as before.
  template <class... Parts>
  void refuse(std::string_view name, std::string_view reason, const Parts&... parts) const {
    send(Notice::Severity::error, name, reason, parts...);
  }
  template <class... Parts>
  void note(std::string_view name, std::string_view reason, const Parts&... parts) const {
    send(Notice::Severity::normal, name, reason, parts...);
  }
  /// A text whose wording varies, counted by `kind`.
  void post(Notice::Severity severity, std::string kind, std::string text) const {
    board.post({client, severity, std::move(text)}, std::move(kind), now, out);
  }

 private:
  /// "name parts…: reason".
  template <class... Parts>
  void send(Notice::Severity severity, std::string_view name, std::string_view reason,
            const Parts&... parts) const {
    post(severity, textOf(name, '/', reason), textOf(name, parts..., ": ", reason));
  }
};

}  // namespace hapticd::scene
