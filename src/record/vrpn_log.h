// VRPN's own log files, which its clients open as NAME@file:///path: a cookie, then messages as they were
// sent.
#pragma once

#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "record/archive.h"
#include "wire/codec.h"
#include "wire/names.h"

namespace hapticd::record {

/// Writes one file; names of senders and types are described before they are first used.
class VrpnLog {
 public:
  /// Throws RecordingError when the file cannot be written.
  explicit VrpnLog(const std::filesystem::path& file);
  ~VrpnLog();
  VrpnLog(const VrpnLog&) = delete;
  VrpnLog& operator=(const VrpnLog&) = delete;

  wire::LocalSender addSender(std::string_view name);
  void add(wire::Time time, wire::LocalSender sender, const wire::Message& message);
  /// Throws RecordingError when the file could not be written whole.
  void close();

 private:
  void entry(wire::Time time, std::int32_t sender, std::int32_t type, wire::ByteView payload);
  void describe(wire::Time time, std::int32_t kind, std::int32_t id, const std::string& name);
  void write(wire::ByteView bytes);

  std::filesystem::path path_;
  std::FILE* file_;
  wire::LocalNames names_;
  std::set<std::int32_t> senders_;  // that were described
  std::set<std::int32_t> types_;
};

}  // namespace hapticd::record
