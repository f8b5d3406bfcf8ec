// Recordings are read as they were written; cut and damaged ones are reported.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "record/block_file.h"
#include "record/crc32.h"
#include "record/fields.h"
#include "record/recorder.h"
#include "record/recording_file.h"
#include "record/recording_reader.h"
#include "record/scene_event_codec.h"

namespace hapticd::record {
namespace {

using test::RecordingFile;

// Fills every field with random bits, by the lists of fields that the file is written by: their structured
// bindings guarantee that no field is missing.
class Filler {
 public:
  explicit Filler(std::uint64_t seed) : random_(seed) {}

  template <class T>
  void operator()(const char*, T& value) {
    fill(value);
  }
  template <Scalar T>
  void fill(T& value) {
    const std::uint64_t bits = random_();
    std::memcpy(&value, &bits, sizeof value);
  }
  void fill(bool& value) { value = random_() % 2 == 0; }
  template <IsEnum T>
  void fill(T& value) {
    value = static_cast<T>(random_() % 3);
  }
  void fill(std::string& text) {
    text.resize(random_() % 40);
    for (char& c : text) c = static_cast<char>(random_());
  }
  template <class T>
  void fill(std::vector<T>& list) {
    list.resize(random_() % 20);
    for (T& item : list) fill(item);
  }
  template <class T, std::size_t N>
  void fill(std::array<T, N>& list) {
    for (T& item : list) fill(item);
  }
  template <class S, int R, int C>
  void fill(Eigen::Matrix<S, R, C>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) fill(m.data()[i]);
  }
  void fill(geometry::Quat& q) { fill(q.coeffs()); }
  template <class T>
  void fill(T& value) requires(std::is_class_v<T>) {
    fields(value, *this);
  }

 private:
  std::mt19937_64 random_;
};

template <class T>
Bytes packed(const T& value) {
  Bytes bytes;
  Packer(bytes).put(value);
  return bytes;
}

Bytes packedEvent(const SceneEvent& event) {
  Bytes bytes;
  packSceneEvent(bytes, event.scene, event.client, event.time, event.command ? &*event.command : nullptr);
  return bytes;
}

// One of each command, with random values.
std::vector<SceneEvent> oneOfEach(std::uint64_t seed) {
  Filler filler(seed);
  std::vector<SceneEvent> events;
  scene::forEachCommand([&]<class C>() {
    C command;
    filler.fill(command);
    events.push_back({3, 14, 1592, scene::SceneCommand(std::move(command))});
  });
  events.push_back({1, 2, 3, std::nullopt});
  return events;
}

RC_GTEST_PROP(Commands, AreReadAsTheyWereWritten, (std::uint64_t seed)) {
  for (const SceneEvent& event : oneOfEach(seed)) {
    const Bytes bytes = packedEvent(event);
    SceneEvent back;
    std::string error;
    RC_ASSERT(unpackSceneEvent(bytes, back, error));
    RC_ASSERT(back.scene == event.scene && back.client == event.client && back.time == event.time);
    RC_ASSERT(back.command.has_value() == event.command.has_value());
    if (event.command) RC_ASSERT(back.command->index() == event.command->index());
    RC_ASSERT(packedEvent(back) == bytes);
  }
}

RC_GTEST_PROP(Commands, TruncatedOnesAreRefused, (std::uint64_t seed)) {
  for (const SceneEvent& event : oneOfEach(seed)) {
    const Bytes bytes = packedEvent(event);
    SceneEvent back;
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      std::string error;
      RC_ASSERT(!unpackSceneEvent(ByteView(bytes).first(size), back, error));
      RC_ASSERT(!error.empty());
    }
  }
}

// Files keep their meaning: no other command gets the number.
TEST(Commands, KeepTheirNumbers) {
  Bytes bytes;
  const scene::SceneCommand command = scene::SetTransform{5, {1, 2}};
  packSceneEvent(bytes, 1, 2, 3, &command);
  ASSERT_GT(bytes.size(), 22U);
  EXPECT_EQ(wire::loadBig<std::uint16_t>(bytes.data() + 16), 13);
  EXPECT_EQ(wire::loadBig<std::int32_t>(bytes.data() + 18), 5);
  EXPECT_EQ(wire::loadBig<double>(bytes.data() + 22 + 8), 2.0);
  EXPECT_STREQ(nameOf(command), "SetTransform");
}

// The types of the members of a command, as docs/recording-format.md names them.
class TypeLister {
 public:
  template <class T>
  void operator()(const char* name, const T& value) {
    text_ += (text_.empty() ? "" : ", ") + typeOf(value) + " `" + name + "`";
  }
  std::string text() const { return text_.empty() ? "-" : text_; }

 private:
  static std::string typeOf(bool) { return "truth"; }
  static std::string typeOf(float) { return "f32"; }
  static std::string typeOf(double) { return "f64"; }
  static std::string typeOf(std::int32_t) { return "i32"; }
  static std::string typeOf(std::uint32_t) { return "u32"; }
  static std::string typeOf(std::int64_t) { return "i64"; }
  static std::string typeOf(const std::string&) { return "text"; }
  template <IsEnum T>
  static std::string typeOf(T) {
    return "i32";
  }
  template <class T>
  static std::string typeOf(const std::vector<T>&) {
    return "list of " + typeOf(T());
  }
  template <class T, std::size_t N>
  static std::string typeOf(const std::array<T, N>&) {
    return typeOf(T()) + "[" + std::to_string(N) + "]";
  }
  template <class S, int R>
  static std::string typeOf(const Eigen::Matrix<S, R, 1>&) {
    return typeOf(S()) + "[" + std::to_string(R) + "]";
  }

  std::string text_;
};

TEST(Commands, AreInTheDocument) {
  std::string table;
  scene::forEachCommand([&]<class C>() {
    TypeLister types;
    const C command{};
    fields(command, types);
    table +=
        "| " + std::to_string(commandNumber<C>()) + " | `" + C::kInfo.name + "` | " + types.text() + " |\n";
  });
  std::ifstream in(HAPTICD_TESTDATA "/../docs/recording-format.md");
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  EXPECT_NE(text.find(table), std::string::npos) << "put this table into docs/recording-format.md:\n"
                                                 << table;
}

realtime::TickRecord anyTick(Filler& filler, std::uint64_t number) {
  realtime::TickRecord tick;
  filler.fill(tick.report.device);
  filler.fill(tick.report.rendering);
  filler.fill(tick.report.guard);
  filler.fill(tick.report.timing);
  filler.fill(tick.report.force_N);
  filler.fill(tick.control);
  filler.fill(tick.haveState);
  filler.fill(tick.written);
  filler.fill(tick.discarded);
  filler.fill(tick.expired);
  tick.report.tick = number;
  tick.report.rendering.contactCount = static_cast<std::uint32_t>(number % 5);
  for (std::uint32_t i = 0; i < number % 5; ++i) filler.fill(tick.report.rendering.contacts[i]);
  tick.report.T_world_device.translation().x() = static_cast<double>(number / 3);
  tick.report.guard.counts[4] = static_cast<std::uint32_t>(number / 4);
  if (number >= 10) tick.report.device.gripper_rad = 0.01 * static_cast<double>(number);
  return tick;
}

Bytes allOf(const realtime::TickRecord& tick) {
  Bytes bytes;
  TickPacker().add(tick, bytes);  // a first one holds everything
  return bytes;
}

RC_GTEST_PROP(Ticks, AreReadAsTheyWereWritten, (std::uint64_t seed)) {
  Filler filler(seed);
  std::vector<realtime::TickRecord> ticks;
  Bytes run;
  TickPacker packer;
  for (std::uint64_t i = 1; i <= 20; ++i) {
    ticks.push_back(anyTick(filler, i));
    packer.add(ticks.back(), run);
  }
  TickUnpacker unpacker(run);
  realtime::TickRecord back;
  for (const realtime::TickRecord& tick : ticks) {
    RC_ASSERT(unpacker.next(back));
    RC_ASSERT(allOf(back) == allOf(tick));
    RC_ASSERT(back.report.device.gripper_rad == tick.report.device.gripper_rad);
  }
  RC_ASSERT(!unpacker.next(back));
  RC_ASSERT(unpacker.ok());
}

realtime::ServoMemory anyMemory(Filler& filler) {
  realtime::ServoMemory memory;
  memory.tick = 7;
  memory.whole = true;
  memory.render.effectCount = 3;
  for (realtime::EffectMemory& effect : memory.render.effects) {
    filler.fill(effect);
    effect.begin &= INT64_MAX;
    effect.since = -1;
  }
  memory.render.planeCount = 2;
  for (realtime::PlaneMemory& plane : memory.render.planes) {
    filler.fill(plane);
    plane.placed &= INT64_MAX;
  }
  memory.render.buzzBegin = 5;
  filler.fill(memory.guard);
  memory.guard.thermal.newest &= 31;
  memory.guard.thermal.filled &= 0xFFFF;
  return memory;
}

Bytes allOf(const realtime::ServoMemory& memory) {
  Bytes bytes;
  packMemory(memory, bytes);
  return bytes;
}

bool isTaken(const realtime::ServoMemory& memory) {
  const Bytes bytes = allOf(memory);
  Unpacker in(bytes);
  realtime::ServoMemory back;
  return unpackMemory(in, back) && in.rest().empty() && allOf(back) == bytes;
}

RC_GTEST_PROP(Memories, AreReadAsTheyWereWritten, (std::uint64_t seed)) {
  Filler filler(seed);
  const realtime::ServoMemory memory = anyMemory(filler);
  RC_ASSERT(isTaken(memory));
  const Bytes bytes = allOf(memory);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Unpacker in(ByteView(bytes).first(size));
    realtime::ServoMemory back;
    RC_ASSERT(!unpackMemory(in, back));
  }
}

TEST(Memories, ImpossibleStoresOfEnergyAreRefused) {
  const auto isTakenWith = [](auto&& change) {
    realtime::ServoMemory memory;
    memory.remote.force = 1;
    change(memory.remote);
    Bytes bytes;
    packRemoteMemory(memory, bytes);
    Unpacker in(bytes);
    realtime::ServoMemory back;
    return unpackRemoteMemory(in, back);
  };
  using realtime::RemoteMemory;
  const double nan = std::nan("");
  EXPECT_TRUE(isTakenWith([](RemoteMemory&) {}));
  EXPECT_FALSE(isTakenWith([](RemoteMemory& m) { m.energy_J = 1; })) << "more than the store holds";
  EXPECT_FALSE(isTakenWith([](RemoteMemory& m) { m.budget.capacity_J = -1; }));
  EXPECT_FALSE(isTakenWith([&](RemoteMemory& m) { m.budget.capacity_J = nan; }));
  EXPECT_FALSE(isTakenWith([&](RemoteMemory& m) { m.budget.refill_W = nan; }));
  EXPECT_FALSE(isTakenWith([&](RemoteMemory& m) { m.energy_J = nan; }));
  EXPECT_FALSE(isTakenWith([&](RemoteMemory& m) { m.corrections_J = nan; }));
  EXPECT_FALSE(isTakenWith([](RemoteMemory& m) { m.cut = 1.1; }));
}

TEST(Memories, ImpossibleOnesAreRefused) {
  Filler filler(1);
  const realtime::ServoMemory possible = anyMemory(filler);
  const auto isTakenWith = [&](auto&& change) {
    realtime::ServoMemory memory = possible;
    change(memory);
    return isTaken(memory);
  };
  EXPECT_TRUE(isTakenWith([](auto&) {}));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.render.effects[0].begin = -1; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.render.effects[0].since = -2; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.render.planes[1].placed = -1; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.render.buzzBegin = -1; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.guard.thermal.newest = 51; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.guard.thermal.newest = -1; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.guard.thermal.filled = 100'000'000; }));
  EXPECT_FALSE(isTakenWith([](auto& m) { m.guard.thermal.filled = -1; }));
  for (const std::size_t countAt : {9U, 9U + 4U}) {  // without effects: the count of planes
    realtime::ServoMemory none = possible;
    none.render.effectCount = 0;
    Bytes bytes = allOf(none);
    wire::storeBig(bytes.data() + countAt, std::uint32_t{65});
    Unpacker in(bytes);
    realtime::ServoMemory back;
    EXPECT_FALSE(unpackMemory(in, back));
  }
}

RC_GTEST_PROP(Header, IsReadAsItWasWritten, (std::uint64_t seed)) {
  Filler filler(seed);
  RecordingHeader header;
  filler.fill(header);
  const Bytes bytes = packed(header);
  Unpacker in(bytes);
  const auto back = in.next<RecordingHeader>();
  RC_ASSERT(in.ok() && in.rest().empty());
  RC_ASSERT(packed(back) == bytes);
}

TEST(Unpacker, ALengthBeyondTheBytesIsRefusedWithoutAllocatingIt) {
  const Bytes bytes = packed(std::uint32_t{0xFFFFFFFF});
  Unpacker list(bytes);
  EXPECT_TRUE(list.next<std::vector<double>>().empty());
  EXPECT_FALSE(list.ok());
  Unpacker text(bytes);
  EXPECT_TRUE(text.next<std::string>().empty());
  EXPECT_FALSE(text.ok());
}

TEST(Crc32, IsThatOfZlib) {
  const std::string text = "123456789";
  const ByteView bytes = std::as_bytes(std::span(text));
  EXPECT_EQ(crc32(bytes), 0xCBF43926U);
  EXPECT_EQ(crc32(bytes.subspan(4), crc32(bytes.first(4))), 0xCBF43926U);
}

// A small recording with every kind of block.
class SmallSession : public testing::Test {
 protected:
  void SetUp() override {
    Recorder recorder(file_.path(), [](RecorderProblem, const std::string& text) { ADD_FAILURE() << text; });
    RecordedDevice device;
    device.names = {"Phantom"};
    recorder.addDevice(device);
    recorder.start(77, "config");
    const scene::SceneCommand command = scene::AddObject{4, -1};
    recorder.recordCommand(0, 9, 100, &command);
    recorder.recordPublish(0, 110, 1, {105, 107});
    recorder.recordLeft(0, 9, 115);
    recorder.recordCommand(0, 9, 120, nullptr);
    Filler filler(1);
    realtime::ServoMemory memory = anyMemory(filler);
    memory.remote = {.contacts = 3,
                     .force = 4,
                     .corrections_J = 0.01,
                     .started = true,
                     .budget = {0.01, 0.03, 0.02},
                     .energy_J = -0.02,
                     .spent = true,
                     .cut = 0.5};
    recorder.memoryRing(0).push(memory);
    for (std::uint64_t i = 1; i <= 3; ++i) recorder.ring(0).push(anyTick(filler, i));
    recorder.finish();
    std::ifstream in(file_.path(), std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(in), {});
  }

  // Rewrites the file and reads it: the number of events, and the remark or error.
  std::pair<std::size_t, std::string> read(const std::string& bytes) {
    std::ofstream(file_.path(), std::ios::binary) << bytes;
    std::size_t events = 0;
    try {
      RecordingReader reader(file_.path());
      for (RecordingEvent event; reader.next(event);) ++events;
      return {events, reader.remark()};
    } catch (const RecordingError& error) {
      return {events, error.what()};
    }
  }

  RecordingFile file_;
  std::string bytes_;
};

TEST_F(SmallSession, HasWhatWasRecorded) {
  RecordingReader reader(file_.path());
  EXPECT_EQ(reader.header().config, "config");
  EXPECT_EQ(reader.header().wallOffset, 77);
  EXPECT_EQ(reader.header().program.rfind("hapticd ", 0), 0U);
  RecordingEvent event;
  ASSERT_TRUE(reader.next(event));
  EXPECT_EQ(std::get<scene::AddObject>(*std::get<SceneEvent>(event).command).object, 4);
  ASSERT_TRUE(reader.next(event));
  EXPECT_EQ(std::get<PublishEvent>(event).revision, 1U);
  EXPECT_EQ(std::get<PublishEvent>(event).stopwatch, (std::vector<Nanos>{105, 107}));
  ASSERT_TRUE(reader.next(event));
  EXPECT_EQ(std::get<LeftEvent>(event).client, 9U);
  EXPECT_EQ(std::get<LeftEvent>(event).time, 115);
  ASSERT_TRUE(reader.next(event));
  EXPECT_FALSE(std::get<SceneEvent>(event).command);
  ASSERT_TRUE(reader.next(event));
  EXPECT_EQ(std::get<MemoryEvent>(event).memory.tick, 7U);
  const realtime::RemoteMemory& remote = std::get<MemoryEvent>(event).memory.remote;
  EXPECT_EQ(remote.contacts, 3U);
  EXPECT_EQ(remote.force, 4U);
  EXPECT_EQ(remote.corrections_J, 0.01);
  EXPECT_TRUE(remote.started && remote.spent);
  EXPECT_EQ(remote.budget.capacity_J, 0.03);
  EXPECT_EQ(remote.energy_J, -0.02);
  EXPECT_EQ(remote.cut, 0.5);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    ASSERT_TRUE(reader.next(event));
    EXPECT_EQ(std::get<TickEvent>(event).tick.report.tick, i);
  }
  ASSERT_TRUE(reader.next(event));
  EXPECT_TRUE(std::holds_alternative<EndEvent>(event));
  EXPECT_FALSE(reader.next(event));
  EXPECT_EQ(reader.remark(), "");
}

TEST_F(SmallSession, CutAtAnyByteIsReadToTheLastWholeBlock) {
  const std::string whole = bytes_;
  const std::size_t all = read(whole).first;
  std::size_t before = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto [events, remark] = read(whole.substr(0, size));
    EXPECT_NE(remark, "") << size;
    EXPECT_GE(events, before) << "a longer part of the file gave fewer events: " << size;
    EXPECT_LE(events, all);
    before = events;
  }
  EXPECT_EQ(before, all - 1);
}

TEST_F(SmallSession, ADamagedByteIsReportedAtItsBlock) {
  const std::string whole = bytes_;
  // The positions of the blocks.
  std::vector<std::uint64_t> starts;
  BlockReader blocks(file_.path());
  for (BlockReader::Block block; blocks.next(block);) starts.push_back(block.offset);
  for (std::size_t at = kMagicBytes; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    const std::string remark = read(damaged).second;
    const std::uint64_t block = *(std::upper_bound(starts.begin(), starts.end(), at) - 1);
    EXPECT_NE(remark.find("at byte " + std::to_string(block) + " of " + std::to_string(whole.size())),
              std::string::npos)
        << at << ": " << remark;
  }
}

TEST_F(SmallSession, AnotherOneBehindItIsNamed) {
  const std::string whole = bytes_;
  const auto [events, remark] = read(whole + whole);
  EXPECT_EQ(events, read(whole).first);
  EXPECT_EQ(remark, "another recording begins at byte " + std::to_string(whole.size()) + " of " +
                        std::to_string(2 * whole.size()) + "; everything before it was read");
}

TEST_F(SmallSession, NewerVersionsAndOtherFilesAreRefused) {
  Bytes file(magic().begin(), magic().end());
  appendBlock(file, BlockKind::header, packed(kFormatVersion + 1));
  const std::string newer(reinterpret_cast<const char*>(file.data()), file.size());
  EXPECT_NE(read(newer).second.find("version 3 of the format, this program reads versions 1 to 2"),
            std::string::npos);
  EXPECT_NE(read("time,x\n1,2\n").second.find("is not a recording"), std::string::npos);
  EXPECT_THROW(RecordingReader("/nowhere/x.haptics"), RecordingError);
}

TEST_F(SmallSession, DevicesHaveAtMost32Buttons) {
  const auto readWith = [&](int buttons) {
    std::filesystem::remove(file_.path());
    {
      Recorder recorder(file_.path(),
                        [](RecorderProblem, const std::string& text) { ADD_FAILURE() << text; });
      RecordedDevice device;
      device.names = {"Phantom"};
      device.buttons = buttons;
      recorder.addDevice(device);
      recorder.start(77, "config");
      recorder.finish();
    }
    std::ifstream in(file_.path(), std::ios::binary);
    return read({std::istreambuf_iterator<char>(in), {}}).second;
  };
  EXPECT_EQ(readWith(32), "");
  EXPECT_NE(readWith(33).find("a device with 33 buttons"), std::string::npos);
  EXPECT_NE(readWith(2'000'000'000).find("a device with 2000000000 buttons"), std::string::npos);
  EXPECT_NE(readWith(-1).find("a device with -1 buttons"), std::string::npos);
}

// Version 2 differs only in ticks with a gripper, and these have none.
TEST_F(SmallSession, AFileOfVersion1IsReadAsBefore) {
  const auto now = read(bytes_);
  Bytes old(magic().begin(), magic().end());
  std::ofstream(file_.path(), std::ios::binary) << bytes_;
  BlockReader blocks(file_.path());
  for (BlockReader::Block block; blocks.next(block);) {
    Bytes content(block.content.begin(), block.content.end());
    if (block.kind == BlockKind::header) wire::storeBig(content.data(), std::uint32_t{1});
    appendBlock(old, block.kind, content);
  }
  ASSERT_EQ(old.size(), bytes_.size());
  EXPECT_EQ(read(std::string(reinterpret_cast<const char*>(old.data()), old.size())), now);
  EXPECT_EQ(now.second, "");
}

TEST_F(SmallSession, UnknownKindsOfBlocksAreSkipped) {
  Bytes extra;
  appendBlock(extra, static_cast<BlockKind>(77), packed(std::string("of the future")));
  const auto plain = read(bytes_);
  const auto more = read(bytes_ + std::string(reinterpret_cast<const char*>(extra.data()), extra.size()));
  EXPECT_EQ(more, plain);
}

TEST_F(SmallSession, LossesAreAddedUpAndNamed) {
  using What = LostEvent::What;
  Bytes losses;
  for (const LostEvent& lost : {LostEvent{What::sceneEvents, 0, 2},
                                {What::ticks, 0, 12},
                                {What::sceneEvents, 0, 3},
                                {What::streamed, 0, 4}})
    appendBlock(losses, BlockKind::lost, packed(lost));
  const std::string all(reinterpret_cast<const char*>(losses.data()), losses.size());
  EXPECT_EQ(read(bytes_ + all).second,
            "the recorder lost 12 ticks, 5 scene events, 4 streamed values: what follows them may differ");
  EXPECT_EQ(read(bytes_.substr(0, bytes_.size() - 20) + all.substr(0, all.size() / 4)).second,
            "the recorder lost 2 scene events: what follows them may differ; the recording has no end: the "
            "server was killed or is still recording");
}

}  // namespace
}  // namespace hapticd::record
