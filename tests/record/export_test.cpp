// Files for other programs, byte by byte where those programs are strict.
#include "record/export.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <fstream>

#include "base/fake_world.h"
#include "record/recording_file.h"
#include "record/sidecar.h"
#include "record/text_fields.h"
#include "record/vrpn_log.h"
#include "wire/system.h"

namespace hapticd::record {
namespace {

using test::RecordingFile;

std::string textOf(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Csv, HasAColumnForEachNumberAndQuotesNames) {
  RecordingFile file;
  CsvFile csv(file.path());
  Sample sample;
  sample.device = "Left, \"my\" hand";
  sample.time_ns = 1'700'000'000'123'456'789;
  sample.force_N = {0.1, -2, 1e-300};
  sample.guardActive = Trip::late | Trip::stopped;
  csv.add(sample);
  csv.close();
  EXPECT_EQ(textOf(file.path()),
            "device,time_ns,tick,revision,hip_x_m,hip_y_m,hip_z_m,proxy_x_m,proxy_y_m,proxy_z_m,velocity_"
            "x_m_per_s,"
            "velocity_y_m_per_s,velocity_z_m_per_s,qx,qy,qz,qw,force_x_N,force_y_N,force_z_N,depth_m,"
            "touching,object,"
            "buttons,guard_active,guard_latched,gripper_rad,rendered_force_x_N,rendered_force_y_N,rendered_"
            "force_z_N,"
            "normal_x,normal_y,normal_z,contact_point_x_m,contact_point_y_m,contact_point_z_m,render_status,"
            "wakeup_error_ns,compute_ns\n"
            "\"Left, \"\"my\"\" "
            "hand\",1700000000123456789,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1,0.1,-2,1e-300,0,0,-1,0,late+stopped,,,,"
            ",,,,,,,,,,\n");
}

TEST(Csv, OptionalValuesFillTheirColumns) {
  RecordingFile file;
  CsvFile csv(file.path());
  Sample sample;
  sample.gripper_rad = 0.25;
  sample.renderedForce_N = {1, 2, 3};
  sample.compute_ns = 7;
  csv.add(sample);
  csv.close();
  const std::string text = textOf(file.path());
  EXPECT_EQ(text.substr(text.find(",0.25,")), ",0.25,1,2,3,,,,,,,,,7\n");
}

TEST(Csv, AFileThatCannotBeCreatedIsRefused) {
  EXPECT_THROW(CsvFile("/nowhere/x.csv"), RecordingError);
  EXPECT_THROW(McapFile("/nowhere/x.mcap"), RecordingError);
  EXPECT_THROW(VrpnLog("/nowhere/x.vrpn"), RecordingError);
}

TEST(ExportFile, WhatIsNotClosedMayLeaveNoTrace) {
  RecordingFile file;
  const std::filesystem::path part = file.path().string() + ".part";
  { CsvFile csv(file.path(), Unfinished::dropped); }
  EXPECT_FALSE(std::filesystem::exists(file.path()));
  EXPECT_FALSE(std::filesystem::exists(part));
  std::ofstream(file.path()) << "good";
  {
    McapFile mcap(file.path(), Unfinished::dropped);
    VrpnLog log(file.path(), Unfinished::dropped);
    EXPECT_EQ(textOf(file.path()), "good");
  }
  EXPECT_EQ(textOf(file.path()), "good");
  ExportFile whole(file.path(), Unfinished::dropped);
  whole.write("better");
  whole.flush();
  EXPECT_EQ(textOf(file.path()), "good");
  whole.close();
  EXPECT_EQ(textOf(file.path()), "better");
  EXPECT_FALSE(std::filesystem::exists(part));
  { ExportFile("/dev/null", Unfinished::dropped).write("a device is written as it is"); }
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(ExportFile, ALinkStaysOne) {
  RecordingFile file;
  RecordingFile link;
  std::ofstream(file.path()) << "good";
  std::filesystem::create_symlink(file.path(), link.path());
  ExportFile whole(link.path(), Unfinished::dropped);
  whole.write("better");
  whole.close();
  EXPECT_TRUE(std::filesystem::is_symlink(link.path()));
  EXPECT_EQ(textOf(file.path()), "better");
}

TEST(ExportFile, ALinkToNothingStaysOneAndMakesTheFile) {
  RecordingFile file;
  RecordingFile link;
  std::filesystem::create_symlink(file.path().filename(), link.path());
  ExportFile whole(link.path(), Unfinished::dropped);
  whole.write("good");
  whole.close();
  EXPECT_TRUE(std::filesystem::is_symlink(link.path()));
  EXPECT_EQ(textOf(file.path()), "good");
}

TEST(ExportFile, AFileNamedAsAnUnfinishedOneStays) {
  RecordingFile file;
  const std::filesystem::path part = file.path().string() + ".part";
  std::ofstream(part) << "of the user";
  { ExportFile dropped(file.path(), Unfinished::dropped); }
  EXPECT_EQ(textOf(part), "of the user");
  ExportFile whole(file.path(), Unfinished::dropped);
  whole.write("good");
  whole.close();
  EXPECT_EQ(textOf(file.path()), "good");
  EXPECT_EQ(textOf(part), "of the user");
  std::filesystem::remove(part);
}

TEST(ExportFile, AFullDiskKeepsTheFileThatWasToBeReplaced) {
  base::FakeWorld world;
  world.files.create("/my.csv", base::Existing::refuse)->write("good");
  world.files.freeBytes = 0;
  {
    ExportFile whole("/my.csv", Unfinished::dropped);
    whole.write("better");
    EXPECT_THROW(whole.close(), RecordingError);
  }
  EXPECT_EQ(world.files.list("/"), std::vector<std::string>{"my.csv"});
}

TEST(ExportFile, OfAFullDiskNoEmptyFileIsLeft) {
  base::FakeWorld world;
  world.files.freeBytes = 0;
  for (const bool closed : {true, false}) {
    ExportFile kept("/my.csv", Unfinished::kept);
    kept.write("head");
    if (closed) {
      EXPECT_THROW(kept.close(), RecordingError);
    }
  }
  EXPECT_EQ(world.files.list("/"), std::vector<std::string>{});
  world.files.freeBytes = 3;
  {
    ExportFile kept("/my.csv", Unfinished::kept);
    kept.write("head");
    EXPECT_THROW(kept.flush(), RecordingError);
  }
  EXPECT_EQ(world.files.text("/my.csv"), "hea");
}

// A disk that is full for this process.
class FullDisk {
 public:
  FullDisk() : signal_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit none{.rlim_cur = 0, .rlim_max = before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &none);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  void (*const signal_)(int);
  rlimit before_{};
};

TEST(ExportFile, WhatIsKeptReplacesAFileByItsFirstBytes) {
  const RecordingFile file;
  const std::filesystem::path part = file.path().string() + ".part";
  std::ofstream(file.path()) << "good";
  for (const bool closed : {true, false}) {
    bool failed = false;
    {
      const FullDisk full;
      ExportFile kept(file.path(), Unfinished::kept);
      kept.write("better");
      try {
        if (closed) kept.close();
      } catch (const RecordingError&) {
        failed = true;
      }
    }
    EXPECT_EQ(failed, closed);
    EXPECT_EQ(textOf(file.path()), "good");
    EXPECT_FALSE(std::filesystem::exists(part));
  }
  ExportFile kept(file.path(), Unfinished::kept);
  kept.write("better");
  EXPECT_EQ(textOf(file.path()), "good");
  kept.flush();
  EXPECT_EQ(textOf(file.path()), "better");
  EXPECT_FALSE(std::filesystem::exists(part));
  {
    const FullDisk full;
    kept.write(", longer");
    EXPECT_THROW(kept.close(), RecordingError);
  }
  EXPECT_EQ(textOf(file.path()), "better");
  { ExportFile(file.path(), Unfinished::kept).write("best"); }
  EXPECT_EQ(textOf(file.path()), "best");
}

// Of a vrpn.cfg in Latin-1. Readers of CSV and MCAP refuse a whole file for such a byte.
TEST(Export, NamesThatAreNotUtf8AreMadeSo) {
  Sample sample;
  sample.device =
      "Gr\xf6\xdf"
      "e";
  RecordingFile file;
  CsvFile csv(file.path());
  csv.add(sample);
  csv.close();
  RecordingFile other;
  McapFile mcap(other.path());
  mcap.add(sample);
  mcap.close();
  const std::string rows = textOf(file.path());
  const std::string name =
      "Gr\xef\xbf\xbd\xef\xbf\xbd"
      "e";
  EXPECT_EQ(rows.substr(rows.find('\n') + 1, name.size() + 1), name + ",");
  const std::string messages = textOf(other.path());
  EXPECT_NE(messages.find("/" + name + "/tick"), std::string::npos);
  EXPECT_EQ(messages.find("\xf6\xdf"), std::string::npos);
}

TEST(Json, BytesThatAreNotUtf8AreReplaced) {
  std::string text;
  {
    JsonObject object(text);
    object("name", std::string("\xc3\xa4\xc3\xff"));
  }
  EXPECT_EQ(text, "{\"name\":\"\xc3\xa4\xef\xbf\xbd\xef\xbf\xbd\"}");
}

TEST(Json, NumbersThatAreNotFiniteAreNullAndLongListsAreTheirLength) {
  std::string text;
  {
    JsonObject object(text);
    object("a\"b", std::string("tab\there"));
    object("nan", std::nan(""));
    object("on", true);
    object("list", std::vector<int>{1, 2});
    object("long", std::vector<int>(100));
    object("vector", geometry::Vec3(1, 2, 0.5));
    object("absent", std::optional<double>());
    object("there", std::optional<double>(0.5));
  }
  EXPECT_EQ(
      text,
      R"({"a\"b":"tab\u0009here","nan":null,"on":true,"list":[1,2],"long":100,"vector":[1,2,0.5],"there":0.5})");
}

TEST(Sidecar, CanBeStopped) {
  const std::filesystem::path file = HAPTICD_TESTDATA "/recordings/all_commands_law2.haptics";
  EXPECT_NE(sidecarOf(file).json, "");
  struct Stopped {};
  EXPECT_THROW(sidecarOf(file, [] { throw Stopped(); }), Stopped);
}

struct Entry {
  std::int32_t type, sender;
  std::uint32_t seconds, microseconds;
  Bytes payload;
};

TEST(VrpnLog, DescribesNamesBeforeTheyAreUsed) {
  RecordingFile file;
  VrpnLog log(file.path());
  const wire::LocalSender phantom = log.addSender("Phantom");
  log.add({10, 20}, phantom, wire::Dop{0.25});
  log.add({11, 21}, phantom, wire::Dop{0.5});
  log.close();

  const std::string bytes = textOf(file.path());
  ASSERT_GT(bytes.size(), 24U);
  EXPECT_EQ(bytes.substr(0, 14), "vrpn: ver. 07.");
  std::vector<Entry> entries;
  Unpacker in(std::as_bytes(std::span(bytes)).subspan(24));
  while (!in.rest().empty()) {
    Entry entry;
    in.take(entry.type);
    in.take(entry.sender);
    in.take(entry.seconds);
    in.take(entry.microseconds);
    entry.payload.resize(static_cast<std::size_t>(in.next<std::int32_t>()));
    EXPECT_EQ(in.next<std::int32_t>(), 0);
    for (std::byte& b : entry.payload) b = static_cast<std::byte>(in.next<std::uint8_t>());
    ASSERT_TRUE(in.ok());
    entries.push_back(std::move(entry));
  }
  ASSERT_EQ(entries.size(), 4U);
  EXPECT_EQ(entries[0].type, wire::kSenderDescription);
  EXPECT_EQ(*wire::decodeDescription(entries[0].payload), "Phantom");
  EXPECT_EQ(entries[1].type, wire::kTypeDescription);
  EXPECT_EQ(*wire::decodeDescription(entries[1].payload), wire::info(wire::kindOf<wire::Dop>).name);
  for (const std::size_t i : {2U, 3U}) {
    EXPECT_EQ(entries[i].sender, entries[0].sender) << "a description holds its number as the sender";
    EXPECT_EQ(entries[i].type, entries[1].sender);
    EXPECT_EQ(entries[i].seconds, 8 + i);
  }
  EXPECT_EQ(wire::decode<wire::Dop>(entries[3].payload)->depth, 0.5);
}

}  // namespace
}  // namespace hapticd::record
