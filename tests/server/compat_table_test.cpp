// Checks docs/vrpn-compat.md against the message table and against the tests that it names.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>

#include "wire/messages.h"

namespace hapticd::test {
namespace {

namespace fs = std::filesystem;

const fs::path kTop = fs::path(HAPTICD_TESTDATA).parent_path();

std::string contents(const fs::path& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

// Message name and test name of each row.
std::multimap<std::string, std::string> rows() {
  std::multimap<std::string, std::string> found;
  const std::string text = contents(kTop / "docs/vrpn-compat.md");
  const std::regex row(R"(\n\| `([^`]+)` \| [^|]+ \| `([^`]+)` \|)");
  for (std::sregex_iterator it(text.begin(), text.end(), row), end; it != end; ++it)
    found.emplace((*it)[1], (*it)[2]);
  return found;
}

// Adds "program.Suite.Name" of every test of a folder.
void addTestNames(const fs::path& folder, std::set<std::string>& names) {
  const std::regex program(R"(hapticd_test\(\s*(\w+)([^)]*)\))");
  const std::regex test(R"(\bTEST(?:_F|_P)?\(\s*(\w+)\s*,\s*(\w+)\s*\))");
  const std::string list = contents(folder / "CMakeLists.txt");
  const std::sregex_iterator end;
  for (std::sregex_iterator it(list.begin(), list.end(), program); it != end; ++it) {
    for (const auto& file : fs::recursive_directory_iterator(folder)) {
      if ((*it)[2].str().find(' ' + file.path().lexically_relative(folder).string()) == std::string::npos)
        continue;
      if (!file.is_regular_file()) continue;
      const std::string source = contents(file.path());
      for (std::sregex_iterator t(source.begin(), source.end(), test); t != end; ++t) {
        names.insert((*it)[1].str() + '.' + (*t)[1].str() + '.' + (*t)[2].str());
      }
    }
  }
}

std::set<std::string> testNames() {
  std::set<std::string> names;
  for (const char* folder : {"tests/server", "tests/record"}) addTestNames(kTop / folder, names);
  return names;
}

TEST(CompatTable, HasOneRowForEachMessageAndNoOther) {
  const auto table = rows();
  std::set<std::string> known;
  for (const wire::MessageInfo& info : wire::kMessageInfos) {
    known.emplace(info.name);
    EXPECT_EQ(table.count(std::string(info.name)), 1U) << info.name;
  }
  for (const auto& [message, test] : table) EXPECT_TRUE(known.count(message) == 1) << message;
}

TEST(CompatTable, NamesTestsThatExist) {
  const auto tests = testNames();
  EXPECT_GT(tests.size(), 100U);
  for (const auto& [message, test] : rows())
    EXPECT_TRUE(tests.count(test) == 1) << message << ": no test " << test;
}

}  // namespace
}  // namespace hapticd::test
