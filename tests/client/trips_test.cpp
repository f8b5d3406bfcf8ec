// The table of trips, and what is generated from it. HAPTICD_UPDATE=1 makes this program rewrite the
// generated parts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "hapticd/trips.h"

namespace hapticd::test {
namespace {

using testing::ElementsAre;

TEST(Trips, StandInTheOrderOfTheirBits) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < kTripCount; ++i) {
    EXPECT_EQ(bit(kTrips[i].trip), std::uint32_t{1} << i) << kTrips[i].name;
    EXPECT_EQ(tripOf(kTrips[i].name), kTrips[i].trip);
    names.insert(kTrips[i].name);
    EXPECT_TRUE(kTrips[i].what.ends_with('.')) << kTrips[i].what;
    EXPECT_TRUE(kTrips[i].remedy.ends_with('.')) << kTrips[i].remedy;
  }
  EXPECT_EQ(names.size(), kTripCount);
  EXPECT_FALSE(tripOf("no_such_trip"));
}

// Recordings and clients of earlier versions rely on them.
TEST(Trips, KeepTheirBitsAndNames) {
  const char* const names[] = {"not_finite",    "peak_force",  "thermal",      "slew",           "speed",
                               "late",          "stalled",     "no_state",     "not_calibrated", "dead_man",
                               "inkwell",       "hot",         "device_fault", "stopped",        "disarmed",
                               "geometry_jump", "deep_contact"};
  ASSERT_EQ(std::size(names), kTripCount);
  for (std::size_t i = 0; i < kTripCount; ++i) EXPECT_EQ(nameOf(static_cast<Trip>(i)), names[i]);
}

TEST(Trips, ASetIsReadFromTheBitsOfTheWire) {
  const Trips trips(0x80002010U);  // bit 31 is of a newer server
  EXPECT_THAT(std::vector<Trip>(trips.begin(), trips.end()), ElementsAre(Trip::speed, Trip::stopped));
  auto at = trips.begin();
  EXPECT_EQ(*at++, Trip::speed);
  EXPECT_EQ(*at++, Trip::stopped);
  EXPECT_EQ(at, trips.end());
  EXPECT_EQ(namesOf(trips), "speed+stopped");
  EXPECT_EQ(trips.unknownBits(), 0x80000000U);
  EXPECT_EQ(trips.bits(), 0x80002010U);
  EXPECT_TRUE(trips.contains(Trip::speed));
  EXPECT_FALSE(trips.contains(Trip::late));
  EXPECT_FALSE(trips.empty());
  EXPECT_TRUE(Trips().empty());
  EXPECT_EQ(namesOf({}), "");
}

TEST(Trips, SetsAreCombined) {
  constexpr Trips both = Trip::late | Trip::hot;
  static_assert(both.contains(Trip::late) && both.contains(Trip::hot));
  EXPECT_EQ(both - Trip::late, Trips(Trip::hot));
  EXPECT_EQ(both & Trip::late, Trips(Trip::late));
  EXPECT_EQ(Trips::thatAct(TripAction::latch), Trip::speed | Trip::stalled | Trip::deviceFault);
  EXPECT_TRUE((Trips::thatAct(TripAction::clamp) & Trips::thatAct(TripAction::hold)).empty());
}

// --- the table in docs/safety.md; server/web/page_tables generates the one of the page

std::string markdown() {
  const auto force = [](TripAction action) {
    return action == TripAction::clamp  ? "shaped"
           : action == TripAction::hold ? "zero while it lasts"
                                        : "zero until re-armed";
  };
  std::string text =
      "| bit | name | force | code | what happened | what to do |\n|---|---|---|---|---|---|\n";
  for (const TripInfo& trip : kTrips) {
    text += "| " + std::to_string(static_cast<int>(trip.trip)) + " | `" + std::string(trip.name) + "` | " +
            force(trip.action) + " | " + std::to_string(static_cast<int>(trip.forceError)) + " | " +
            std::string(trip.what) + " | " + std::string(trip.remedy) + " |\n";
  }
  return text;
}

std::string read(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}
bool updates() {
  return std::getenv("HAPTICD_UPDATE") != nullptr;
}
constexpr const char* kRemedy =
    "is not that of include/hapticd/trips.h: run HAPTICD_UPDATE=1 client_test --gtest_filter='Trips.*'";
const std::filesystem::path kTree = HAPTICD_TESTDATA "/..";

TEST(Trips, TheSafetyDocumentHasTheTable) {
  const std::filesystem::path file = kTree / "docs/safety.md";
  std::string text = read(file);
  const std::size_t begin = text.find("| bit | name |");
  ASSERT_NE(begin, std::string::npos) << file;
  const std::size_t end = text.find("\n\n", begin) + 1;
  if (updates()) std::ofstream(file) << text.replace(begin, end - begin, markdown());
  EXPECT_NE(read(file).find(markdown()), std::string::npos) << "the table in " << file << ' ' << kRemedy;
}

}  // namespace
}  // namespace hapticd::test
