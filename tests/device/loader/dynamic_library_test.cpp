// Loading of vendor libraries: order of names, the environment's word, the loader's own words.
#include "device/dynamic_library.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace hapticd::device {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kVariable = "HAPTICD_TEST_LIBRARY";

class DynamicLibraryTest : public testing::Test {
 protected:
  void SetUp() override { unsetenv(kVariable); }
  void TearDown() override { unsetenv(kVariable); }
};

std::string refusal(const LibraryNames& names) {
  try {
    const DynamicLibrary library(names);
    return "loaded " + library.name();
  } catch (const LibraryError& error) {
    return error.what();
  }
}

TEST_F(DynamicLibraryTest, TakesTheFirstNameThatLoads) {
  const DynamicLibrary library({kVariable, {"libhapticd_none.so", MOCK_PLAIN, MOCK_BROKEN}, {}});
  EXPECT_EQ(library.name(), MOCK_PLAIN);
  int (*answer)() = nullptr;
  library.bindOptional(answer, "plainAnswer");
  ASSERT_NE(answer, nullptr);
  EXPECT_EQ(answer(), 42);
}

TEST_F(DynamicLibraryTest, TheEnvironmentsFileIsTheOnlyOneTried) {
  setenv(kVariable, "/nowhere/libvendor.so", 1);
  EXPECT_THAT(refusal({kVariable, {MOCK_PLAIN}, {}}),
              AllOf(HasSubstr("/nowhere/libvendor.so"), HasSubstr(kVariable)));
  setenv(kVariable, MOCK_PLAIN, 1);
  EXPECT_EQ(refusal({kVariable, {"libhapticd_none.so"}, {}}), "loaded " MOCK_PLAIN);
}

TEST_F(DynamicLibraryTest, AFileThatOthersCanChangeIsRefused) {
  setenv(kVariable, "libhapticd_none.so", 1);
  EXPECT_THAT(refusal({kVariable, {}, {}}), AllOf(HasSubstr("not an absolute path"), HasSubstr(kVariable)));
  const std::string copy = testing::TempDir() + "hapticd_library_" + std::to_string(getpid()) + ".so";
  std::filesystem::copy_file(MOCK_PLAIN, copy);
  setenv(kVariable, copy.c_str(), 1);
  chmod(copy.c_str(), 0755);
  EXPECT_EQ(refusal({kVariable, {}, {}}), "loaded " + copy);
  chmod(copy.c_str(), 0757);
  EXPECT_THAT(refusal({kVariable, {}, {}}), HasSubstr("every user may change it"));
  chmod(copy.c_str(), 0755);
  if (geteuid() == 0) {
    ASSERT_EQ(chown(copy.c_str(), 0, 65534), 0);
    chmod(copy.c_str(), 0775);
    EXPECT_THAT(refusal({kVariable, {}, {}}), HasSubstr("all of its group may change it"));
    chmod(copy.c_str(), 0755);
    EXPECT_EQ(refusal({kVariable, {}, {}}), "loaded " + copy);
    ASSERT_EQ(chown(copy.c_str(), 65534, 65534), 0);
    EXPECT_THAT(refusal({kVariable, {}, {}}), HasSubstr("belongs to another user"));
  }
  std::filesystem::remove(copy);
}

TEST_F(DynamicLibraryTest, SaysWhichDependencyIsMissing) {
  EXPECT_THAT(refusal({kVariable, {MOCK_BROKEN}, {}}), HasSubstr("libhapticd_absent.so.1"));
}

TEST_F(DynamicLibraryTest, ReportsEveryNameTried) {
  EXPECT_THAT(refusal({kVariable, {"libhapticd_a.so", "libhapticd_b.so"}, {}}),
              AllOf(HasSubstr("libhapticd_a.so"), HasSubstr("libhapticd_b.so")));
}

TEST_F(DynamicLibraryTest, NamesAllMissingFunctionsAtOnce) {
  DynamicLibrary library({kVariable, {MOCK_PLAIN}, {}});
  int (*answer)() = nullptr;
  int (*other)() = nullptr;
  library.bind(answer, "plainAnswer");
  EXPECT_NO_THROW(library.complain());
  library.bind(other, "plainQuestion");
  library.bind(other, "plainDoubt");
  EXPECT_EQ(other, nullptr);
  try {
    library.complain();
    FAIL() << "did not complain";
  } catch (const LibraryError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("plainQuestion, plainDoubt"), Not(HasSubstr("plainAnswer"))));
  }
}

}  // namespace
}  // namespace hapticd::device
