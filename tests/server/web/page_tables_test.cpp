#include "server/web/page_tables.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "hapticd/trips.h"
#include "server/session/refusal_codes.h"

namespace hapticd::server {
namespace {

TEST(PageTables, TheCommittedFileIsUpToDate) {
  std::ifstream file(HAPTICD_PAGE_TABLES);
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), pageTables()) << "stale: run page_tables > web/src/server_tables.ts";
}

TEST(PageTables, HoldsEveryTripAndRefusalCode) {
  const std::string tables = pageTables();
  for (const TripInfo& trip : kTrips) {
    EXPECT_NE(tables.find("  " + std::string(trip.name) +
                          ": {\n    bit: " + std::to_string(static_cast<int>(trip.trip)) + ",\n"),
              std::string::npos)
        << trip.name;
  }
  for (std::size_t i = 0; i < kRefusals.size(); ++i) {
    EXPECT_EQ(static_cast<std::size_t>(kRefusals[i].code), i);
    EXPECT_NE(tables.find("  " + std::string(kRefusals[i].name) + ": " + std::to_string(i) + ",\n"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace hapticd::server
