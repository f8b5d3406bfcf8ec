#include "record/vrpn_log.h"

#include <cerrno>
#include <cstring>

#include "record/recording.h"
#include "wire/cookie.h"
#include "wire/frame_encoder.h"
#include "wire/system.h"

namespace hapticd::record {

VrpnLog::VrpnLog(const std::filesystem::path& file) : path_(file), file_(std::fopen(file.c_str(), "wb")) {
  if (file_ == nullptr) {
    throw RecordingError("cannot write '" + path_.string() + "': " + std::strerror(errno) +
                       "; name a file in a directory that can be written");
  }
  names_.addSender("VRPN Control");  // the stock library's sender 0
  write(wire::encodeCookie(0));
}

VrpnLog::~VrpnLog() {
  if (file_ != nullptr) std::fclose(file_);
}

wire::LocalSender VrpnLog::addSender(std::string_view name) {
  return names_.addSender(name);
}

void VrpnLog::add(wire::Time time, wire::LocalSender sender, const wire::Message& message) {
  const std::int32_t type = wire::localType(message.kind()).value;
  if (senders_.insert(sender.value).second) {
    describe(time, wire::kSenderDescription, sender.value,
             names_.senders()[static_cast<std::size_t>(sender.value)]);
  }
  if (types_.insert(type).second) {
    describe(time, wire::kTypeDescription, type, names_.types()[static_cast<std::size_t>(type)]);
  }
  Bytes payload(wire::payloadSize(message));
  wire::encodePayload(message, payload.data());
  entry(time, sender.value, type, payload);
}

void VrpnLog::describe(wire::Time time, std::int32_t kind, std::int32_t id, const std::string& name) {
  entry(time, id, kind, wire::encodeDescription(name));
}

// The head of an entry is what the stock library once wrote as a struct; the last number was a pointer.
void VrpnLog::entry(wire::Time time, std::int32_t sender, std::int32_t type, wire::ByteView payload) {
  Bytes head;
  Packer pack(head);
  pack.put(type);
  pack.put(sender);
  pack.put(time.seconds);
  pack.put(time.microseconds);
  pack.put(static_cast<std::int32_t>(payload.size()));
  pack.put(std::int32_t{0});
  write(head);
  write(payload);
}

void VrpnLog::write(wire::ByteView bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) == bytes.size()) return;
  throw RecordingError("writing '" + path_.string() + "' failed: " + std::strerror(errno) +
                     "; make room on the disk");
}

void VrpnLog::close() {
  const int failed = std::fclose(file_);
  file_ = nullptr;
  if (failed != 0) throw RecordingError("writing '" + path_.string() + "' failed: " + std::strerror(errno));
}

}  // namespace hapticd::record
