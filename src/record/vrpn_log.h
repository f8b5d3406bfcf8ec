// VRPN's log files, which its clients open as NAME@file:///path: a cookie, then messages as sent.
#pragma once

#include <filesystem>
#include <map>
#include <set>

#include "record/archive.h"
#include "record/export_file.h"
#include "wire/codec.h"
#include "wire/names.h"

namespace hapticd::record {

/// Writes one file. Names of senders and types are described before their first use.
class VrpnLog {
 public:
  /// Throws RecordingError when the file cannot be written.
  explicit VrpnLog(const std::filesystem::path& file, Unfinished unfinished = Unfinished::kept);

  wire::LocalSender addSender(std::string_view name);
  void add(wire::Time time, wire::LocalSender sender, const wire::Message& message);
  /// The same for an encoded payload, also of a message that this project does not know.
  void addRaw(wire::Time time, wire::LocalSender sender, std::string_view type, wire::ByteView payload);
  /// Throws RecordingError when the file could not be written whole.
  void close() { file_.close(); }

 private:
  void entry(wire::Time time, std::int32_t sender, std::int32_t type, wire::ByteView payload);
  void describe(wire::Time time, std::int32_t kind, std::int32_t id, const std::string& name);

  ExportFile file_;
  wire::LocalNames names_;
  std::set<std::int32_t> senders_;  // already described
  std::set<std::int32_t> types_;    // already described
};

}  // namespace hapticd::record
