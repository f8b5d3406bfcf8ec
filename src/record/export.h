// Samples and what happened around them into files for other programs.
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

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
  /// What a client told the scene; `wall_ns` since the epoch. Not every kind of file has a place for it.
  virtual void addTold(const SceneEvent& /*event*/, Nanos /*wall_ns*/) {}
  virtual void close() = 0;
};

/// One row for each tick of each device; the columns are named in the first.
class CsvFile final : public SampleFile {
 public:
  explicit CsvFile(const std::filesystem::path& file);
  void add(const Sample& sample) override;
  void close() override;

 private:
  std::filesystem::path path_;
  std::ofstream out_;
  std::string row_;
};

/// For each device the ticks, the hand and the proxy as poses that Foxglove draws, and what the guard did;
/// for the scenes, what they were told.
class McapFile final : public SampleFile {
 public:
  explicit McapFile(const std::filesystem::path& file);
  void add(const Sample& sample) override;
  void addTold(const SceneEvent& event, Nanos wall_ns) override;
  void close() override { writer_.close(); }

 private:
  struct Channels {
    std::uint16_t tick, hand, proxy, guard;
    std::uint32_t active = 0, latched = 0;
    bool first = true;
  };
  Channels& channelsOf(const std::string& device);
  void addPose(std::uint16_t channel, const Sample& sample, const geometry::Vec3& position);
  void addGuard(Channels& channels, const Sample& sample);

  McapWriter writer_;
  std::uint16_t tickSchema_, poseSchema_, guardSchema_, commandSchema_;
  std::uint16_t commands_;
  std::map<std::string, Channels> devices_;
  std::string text_;
};

/// Writes all of a session. `remark` says why the session ends early, if it does.
void exportSession(const std::filesystem::path& session, SampleFile& to, std::string& remark);

}  // namespace hapticd::record
