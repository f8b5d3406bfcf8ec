#include "record/vrpn_log.h"

#include "wire/cookie.h"
#include "wire/frame_encoder.h"
#include "wire/system.h"

namespace hapticd::record {

VrpnLog::VrpnLog(const std::filesystem::path& file, Unfinished unfinished) : file_(file, unfinished) {
  names_.addSender("VRPN Control");  // the stock library's sender 0
  file_.write(wire::encodeCookie(0));
}

wire::LocalSender VrpnLog::addSender(std::string_view name) {
  return names_.addSender(name);
}

void VrpnLog::add(wire::Time time, wire::LocalSender sender, const wire::Message& message) {
  Bytes payload(wire::payloadSize(message));
  wire::encodePayload(message, payload.data());
  addRaw(time, sender, wire::info(message.kind()).name, payload);
}

void VrpnLog::addRaw(wire::Time time, wire::LocalSender sender, std::string_view typeName,
                     wire::ByteView payload) {
  const std::int32_t type = names_.addType(typeName).value;
  if (senders_.insert(sender.value).second) {
    describe(time, wire::kSenderDescription, sender.value,
             names_.senders()[static_cast<std::size_t>(sender.value)]);
  }
  if (types_.insert(type).second) {
    describe(time, wire::kTypeDescription, type, names_.types()[static_cast<std::size_t>(type)]);
  }
  entry(time, sender.value, type, payload);
}

void VrpnLog::describe(wire::Time time, std::int32_t kind, std::int32_t id, const std::string& name) {
  entry(time, id, kind, wire::encodeDescription(name));
}

// The head of an entry is a struct that the stock library once wrote as it was in memory; the last number was
// a pointer.
void VrpnLog::entry(wire::Time time, std::int32_t sender, std::int32_t type, wire::ByteView payload) {
  Bytes head;
  Packer pack(head);
  pack.put(type);
  pack.put(sender);
  pack.put(time.seconds);
  pack.put(time.microseconds);
  pack.put(static_cast<std::int32_t>(payload.size()));
  pack.put(std::int32_t{0});
  file_.write(head);
  file_.write(payload);
}

}  // namespace hapticd::record
