#include "record/export.h"

#include <nlohmann/json.hpp>

#include "record/recording_reader.h"
#include "record/scene_event_codec.h"
#include "record/text_fields.h"

namespace hapticd::record {
namespace {

using geometry::Vec3;

nlohmann::json namesIn(Trips trips) {
  nlohmann::json names = nlohmann::json::array();
  for (const Trip trip : trips) names.push_back(nameOf(trip));
  return names;
}

template <class T>
std::string schemaOf() {
  std::string properties;
  const T any{};
  fields(any, JsonSchema(properties));
  return R"({"type":"object","properties":{)" + properties + "}}";
}

constexpr const char* kGuardSchema =
    R"({"type":"object","properties":{"tick":{"type":"integer"},"active":{"type":"array","items":{"type":"string"}},)"
    R"("latched":{"type":"array","items":{"type":"string"}}}})";
constexpr const char* kCommandSchema =
    R"({"type":"object","properties":{"scene":{"type":"integer"},"client":{"type":"integer"},)"
    R"("command":{"type":"string"},"fields":{"type":"object"}}})";
// Foxglove draws messages of this name.
constexpr const char* kPoseSchema =
    R"({"title":"foxglove.PoseInFrame","type":"object","properties":{)"
    R"("timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},"nsec":{"type":"integer"}}},)"
    R"("frame_id":{"type":"string"},"pose":{"type":"object","title":"foxglove.Pose","properties":{)"
    R"("position":{"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"}}},)"
    R"("orientation":{"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},)"
    R"("z":{"type":"number"},"w":{"type":"number"}}}}}}})";

// It lists these.
constexpr const char* kLogSchema =
    R"({"title":"foxglove.Log","type":"object","properties":{)"
    R"("timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer"},"nsec":{"type":"integer"}}},)"
    R"("level":{"type":"integer"},"message":{"type":"string"},"name":{"type":"string"},"file":{"type":"string"},)"
    R"("line":{"type":"integer"}}})";
constexpr int kInformation = 2;  // a level of it

// The time of a message, in a field of its own.
void appendTimestamp(std::string& out, JsonObject& message, Nanos wall_ns) {
  constexpr Nanos kSecond = 1'000'000'000;
  message.key("timestamp");
  JsonObject time(out);
  time("sec", wall_ns / kSecond);
  time("nsec", wall_ns % kSecond);
}

void appendCoordinates(std::string& out, const double* values, const char* names) {
  JsonObject object(out);
  for (int i = 0; names[i] != 0; ++i) object(std::string(1, names[i]).c_str(), values[i]);
}

}  // namespace

CsvFile::CsvFile(const std::filesystem::path& file, Unfinished unfinished) : file_(file, unfinished) {
  file_.write(csvHeader<Sample>());
}

void CsvFile::add(const Sample& sample) {
  row_.clear();
  appendCsvRow(row_, sample);
  file_.write(row_);
}

McapFile::McapFile(const std::filesystem::path& file, Unfinished unfinished)
    : writer_(file, unfinished),
      tickSchema_(writer_.addSchema("hapticd.Tick", schemaOf<Sample>())),
      poseSchema_(writer_.addSchema("foxglove.PoseInFrame", kPoseSchema)),
      guardSchema_(writer_.addSchema("hapticd.Guard", kGuardSchema)),
      commandSchema_(writer_.addSchema("hapticd.SceneCommand", kCommandSchema)),
      logSchema_(writer_.addSchema("foxglove.Log", kLogSchema)),
      commands_(writer_.addChannel(commandSchema_, "/scene/commands")),
      markers_(writer_.addChannel(logSchema_, "/markers")) {}

McapFile::Channels& McapFile::channelsOf(const std::string& device) {
  const auto known = devices_.find(device);
  if (known != devices_.end()) return known->second;
  const std::string topic = "/" + device;
  Channels channels{};
  channels.tick = writer_.addChannel(tickSchema_, topic + "/tick");
  channels.hip = writer_.addChannel(poseSchema_, topic + "/hip");
  channels.proxy = writer_.addChannel(poseSchema_, topic + "/proxy");
  channels.guard = writer_.addChannel(guardSchema_, topic + "/guard");
  channels.first = true;
  return devices_.emplace(device, channels).first->second;
}

void McapFile::add(const Sample& sample) {
  Channels& channels = channelsOf(sample.device);
  text_.clear();
  {
    JsonObject object(text_);
    fields(sample, object);
  }
  writer_.add(channels.tick, sample.time_ns, text_);
  addPose(channels.hip, sample, sample.hip_m);
  addPose(channels.proxy, sample, sample.proxy_m);
  addGuard(channels, sample);
}

void McapFile::addPose(std::uint16_t channel, const Sample& sample, const Vec3& position) {
  text_.clear();
  {
    JsonObject object(text_);
    appendTimestamp(text_, object, sample.time_ns);
    object("frame_id", sample.device);
    object.key("pose");
    JsonObject pose(text_);
    pose.key("position");
    appendCoordinates(text_, position.data(), "xyz");
    pose.key("orientation");
    appendCoordinates(text_, sample.orientation.coeffs().data(), "xyzw");
  }
  writer_.add(channel, sample.time_ns, text_);
}

// With the first sample and on each change.
void McapFile::addGuard(Channels& channels, const Sample& sample) {
  const bool same = sample.guardActive == channels.active && sample.guardLatched == channels.latched;
  if (same && !channels.first) return;
  channels.first = false;
  channels.active = sample.guardActive;
  channels.latched = sample.guardLatched;
  const nlohmann::json guard{{"tick", sample.tick},
                             {"active", namesIn(sample.guardActive)},
                             {"latched", namesIn(sample.guardLatched)}};
  writer_.add(channels.guard, sample.time_ns, guard.dump());
}

void McapFile::addCommand(const SceneEvent& event, Nanos wall_ns) {
  text_.clear();
  {
    JsonObject object(text_);
    object("scene", event.scene);
    object("client", event.client);
    object("command", std::string(event.command ? nameOf(*event.command) : "ClientGone"));
    object.key("fields");
    JsonObject values(text_);
    if (event.command) std::visit([&](const auto& command) { fields(command, values); }, *event.command);
  }
  writer_.add(commands_, wall_ns, text_);
}

void McapFile::addMarker(const std::string& text, Nanos wall_ns) {
  text_.clear();
  {
    JsonObject object(text_);
    appendTimestamp(text_, object, wall_ns);
    object("level", kInformation);
    object("message", text);
    object("name", std::string("marker"));
    object("file", std::string());
    object("line", 0);
  }
  writer_.add(markers_, wall_ns, text_);
}

void exportRecording(const std::filesystem::path& file, SampleFile& to, std::string& remark,
                     const std::function<void()>& beforeEach) {
  RecordingReader reader(file);
  const RecordingHeader& header = reader.header();
  for (RecordingEvent event; reader.next(event);) {
    beforeEach();
    if (const auto* tick = std::get_if<TickEvent>(&event)) {
      to.add(sampleOf(header.devices[tick->device].names.front(), tick->tick.report,
                      reader.wallOffsetAt(tick->tick.report.time)));
    } else if (const auto* command = std::get_if<SceneEvent>(&event)) {
      to.addCommand(*command, command->time + reader.wallOffsetAt(command->time));
    } else if (const auto* marker = std::get_if<MarkerEvent>(&event)) {
      to.addMarker(marker->text, marker->time + reader.wallOffsetAt(marker->time));
    }
  }
  remark = reader.remark();
  to.close();
}

}  // namespace hapticd::record
