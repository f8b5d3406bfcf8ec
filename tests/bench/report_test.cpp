#include "bench/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <fstream>
#include <sstream>

namespace hapticd::bench {
namespace {

const Benchmark kBenchmark{"thing", "What it does", "something else", {}};

Measured measured() {
  Samples ours;
  Samples theirs;
  for (int i = 1; i <= 100; ++i) ours.add(i), theirs.add(2 * i);
  Row row{"a row", "us", ours.summary(), theirs.summary(), {}, "a note"};
  row.checks.push_back({"p50 ratio", row.ratio(), 0.4, false, {}});
  row.checks.push_back({"ticks/s", 998, 997, true, {}});
  row.checks.push_back({"overruns", 3, 0, false, "no SCHED_FIFO"});
  return {&kBenchmark, {{row}, {}, {"a remark"}}, 1};
}

std::string contentsOf(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

TEST(Report, ratioIsOfTheMedians) {
  EXPECT_DOUBLE_EQ(measured().outcome.rows.front().ratio(), 0.5);
  EXPECT_DOUBLE_EQ(Row{}.ratio(), 0);
}

TEST(Report, checksKnowFloorsFromCeilings) {
  EXPECT_TRUE((Check{"", 1, 2, false, {}}).met());
  EXPECT_FALSE((Check{"", 3, 2, false, {}}).met());
  EXPECT_TRUE((Check{"", 3, 2, true, {}}).met());
  EXPECT_FALSE((Check{"", 1, 2, true, {}}).met());
}

TEST(Report, textSaysWhatIsMetMissedAndNotMeasurable) {
  const std::string text = asText(measured());
  EXPECT_NE(text.find("p50 ratio 0.5 (at most 0.4): MISSED"), std::string::npos) << text;
  EXPECT_NE(text.find("ticks/s 998 (at least 997): met"), std::string::npos) << text;
  EXPECT_NE(text.find("overruns 3.00 (at most 0): not measurable here, no SCHED_FIFO"), std::string::npos)
      << text;
  EXPECT_NE(text.find("a remark"), std::string::npos) << text;
}

TEST(Report, markdownHasOneLineForEachRow) {
  const std::string text = asMarkdown({measured()}, {"a machine"});
  EXPECT_NE(text.find("- a machine\n"), std::string::npos);
  EXPECT_NE(text.find("| a row | us | 50.0 / 99.0 / 100 / 100 | 100 / 198 / 200 / 200 | 0.5 |"),
            std::string::npos)
      << text;
}

TEST(Report, filesHaveTheFigures) {
  const std::filesystem::path directory(testing::TempDir());
  writeJson(directory / "bench_report.json", {measured()}, {"a machine"});
  writeCsv(directory / "bench_report.csv", {measured()});
  const auto json = nlohmann::json::parse(contentsOf(directory / "bench_report.json"));
  const auto& row = json.at("benchmarks").at(0).at("rows").at(0);
  EXPECT_DOUBLE_EQ(row.at("ours").at("p99").get<double>(), 99);
  EXPECT_DOUBLE_EQ(row.at("ratio").get<double>(), 0.5);
  EXPECT_FALSE(row.at("checks").at(0).at("met").get<bool>());
  EXPECT_EQ(row.at("checks").at(2).at("not_measurable"), "no SCHED_FIFO");
  EXPECT_NE(contentsOf(directory / "bench_report.csv").find("thing,\"a row\",us,yardstick,100,101,"),
            std::string::npos);
}

TEST(Report, markdownLinksTheFiguresWhereTheyAreWritten) {
  const std::filesystem::path directory = std::filesystem::path(testing::TempDir()) / "bench_report";
  Measured with = measured();
  with.outcome.figures.push_back({"drawn", "A title", "us", 0, 100, {{"one", {}}}});
  std::filesystem::create_directories(directory / "figures");
  writeFigures(directory, {with});
  const std::string text = asMarkdown({with}, {"a machine"});
  const std::string begin = "![A title](";
  const std::size_t at = text.find(begin) + begin.size();
  EXPECT_FALSE(contentsOf(directory / text.substr(at, text.find(')', at) - at)).empty());
  std::filesystem::remove_all(directory);
}

TEST(Report, unwritableFileIsNamed) {
  try {
    writeFile("/nowhere/results.csv", "x");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/results.csv"), std::string::npos);
  }
}

TEST(Report, drawingHasACurveForEachSeries) {
  Figure figure{"file", "A title", "us", 0, 100, {{"one", {}}, {"two", {}}}};
  for (int i = 0; i < 100; ++i) figure.series[0].samples.add(i), figure.series[1].samples.add(1e6);
  const std::string svg = asSvg(figure);
  std::size_t curves = 0;
  for (std::size_t at = 0; (at = svg.find("<polyline", at)) != std::string::npos; ++at) ++curves;
  EXPECT_EQ(curves, 2U);
  EXPECT_NE(svg.find("A title"), std::string::npos);
  EXPECT_NE(svg.find("</svg>"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
}

}  // namespace
}  // namespace hapticd::bench
