// Recordings as files for other programs.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "record/export_file.h"
#include "record/mcap_writer.h"
#include "record/sample.h"

namespace hapticd::record {

/// One kind of file. Errors of writing are RecordingError.
class SampleFile {
 public:
  SampleFile() = default;
  virtual ~SampleFile() = default;
  SampleFile(const SampleFile&) = delete;
  SampleFile& operator=(const SampleFile&) = delete;

  virtual void add(const Sample& sample) = 0;
  /// A scene command of a client, or its end; `wall_ns` since 1970. Some kinds of file leave it out.
  virtual void addCommand(const SceneEvent& /*event*/, Nanos /*wall_ns*/) {}
  /// A moment that a client marked; likewise.
  virtual void addMarker(const std::string& /*text*/, Nanos /*wall_ns*/) {}
  virtual void close() = 0;
};

/// One row for each tick of each device, below a row with the names of the columns.
class CsvFile final : public SampleFile {
 public:
  explicit CsvFile(const std::filesystem::path& file, Unfinished unfinished = Unfinished::kept);
  void add(const Sample& sample) override;
  void close() override { file_.close(); }

 private:
  ExportFile file_;
  std::string row_;
};

/// For each device the ticks, HIP and proxy as poses that Foxglove draws, and the trips of the guard; for the
/// scenes, their commands; and the markers as lines of a log, which Foxglove lists.
class McapFile final : public SampleFile {
 public:
  explicit McapFile(const std::filesystem::path& file, Unfinished unfinished = Unfinished::kept);
  void add(const Sample& sample) override;
  void addCommand(const SceneEvent& event, Nanos wall_ns) override;
  void addMarker(const std::string& text, Nanos wall_ns) override;
  void close() override { writer_.close(); }

 private:
  struct Channels {
    std::uint16_t tick, hip, proxy, guard;
    Trips active, latched;
    bool first = true;
  };
  Channels& channelsOf(const std::string& device);
  void addPose(std::uint16_t channel, const Sample& sample, const geometry::Vec3& position);
  void addGuard(Channels& channels, const Sample& sample);

  McapWriter writer_;
  std::uint16_t tickSchema_, poseSchema_, guardSchema_, commandSchema_, logSchema_;
  std::uint16_t commands_, markers_;
  std::map<std::string, Channels> devices_;
  std::string text_;
};

/// Writes a whole recording and closes `to`. `remark` says what is missing, if anything is.
/// `beforeEach` is called before each event; what it throws ends the export.
void exportRecording(const std::filesystem::path& file, SampleFile& to, std::string& remark,
                     const std::function<void()>& beforeEach);

}  // namespace hapticd::record
