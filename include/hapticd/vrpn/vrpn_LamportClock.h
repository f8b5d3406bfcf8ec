// Vector clocks of several hosts.
#ifndef VRPN_LAMPORT_CLOCK_H
#define VRPN_LAMPORT_CLOCK_H

#include <algorithm>
#include <vector>

#include "vrpn_Types.h"

/// One count for each host.
class vrpn_LamportTimestamp {
 public:
  vrpn_LamportTimestamp(int hosts, const vrpn_uint32* counts) : counts_(counts, counts + hosts) {}

  /// Whether it happened before the other: no count is larger, and one is smaller.
  bool operator<(const vrpn_LamportTimestamp& other) const {
    bool smaller = false;
    for (int i = 0; i < std::max(size(), other.size()); ++i) {
      if ((*this)[i] > other[i]) return false;
      smaller = smaller || (*this)[i] < other[i];
    }
    return smaller;
  }
  /// 0 for a host that it does not know.
  vrpn_uint32 operator[](int host) const {
    return host >= 0 && host < size() ? counts_[static_cast<size_t>(host)] : 0;
  }
  int size() const { return static_cast<int>(counts_.size()); }

 private:
  std::vector<vrpn_uint32> counts_;
};

class vrpn_LamportClock {
 public:
  vrpn_LamportClock(int hosts, int self) : counts_(static_cast<size_t>(hosts)), self_(self) {}

  /// Takes over the larger count of each host.
  void receive(const vrpn_LamportTimestamp& timestamp) {
    for (size_t i = 0; i < counts_.size(); ++i)
      counts_[i] = std::max(counts_[i], timestamp[static_cast<int>(i)]);
  }
  /// Counts an event of this host; the caller deletes the result.
  vrpn_LamportTimestamp* getTimestampAndAdvance() {
    ++counts_[static_cast<size_t>(self_)];
    return new vrpn_LamportTimestamp(static_cast<int>(counts_.size()), counts_.data());
  }

 private:
  std::vector<vrpn_uint32> counts_;
  int self_;
};

#endif
