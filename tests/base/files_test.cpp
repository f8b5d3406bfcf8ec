// Files of the machine and files in memory keep the same contract.
#include "base/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <system_error>

#include "base/fake_world.h"

namespace hapticd::base {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string textOf(Files& files, const std::filesystem::path& path) {
  std::string text;
  for (const std::byte b : files.read(path)) text += static_cast<char>(b);
  return text;
}

void expectError(const std::function<void()>& call, int error, const std::string& path) {
  try {
    call();
    ADD_FAILURE() << "no error for " << path;
  } catch (const std::system_error& thrown) {
    EXPECT_EQ(thrown.code().value(), error) << thrown.what();
    EXPECT_THAT(thrown.what(), HasSubstr(path));
    EXPECT_THAT(thrown.what(), HasSubstr(std::generic_category().message(error)));
  }
}

class OnDisk {
 public:
  OnDisk() {
    std::string name = std::filesystem::temp_directory_path() / "hapticd_files_XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~OnDisk() { std::filesystem::remove_all(folder_); }

  Files& files() { return files_; }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  SystemFiles files_;
  std::filesystem::path folder_;
};

class InMemory {
 public:
  InMemory() { files_.createFolder(folder_); }

  Files& files() { return files_; }
  const std::filesystem::path& folder() const { return folder_; }

 private:
  FakeFiles files_;
  const std::filesystem::path folder_ = "/some/folder";
};

template <class Kind>
class FilesTest : public testing::Test {
 protected:
  Kind kind;
  Files& files = kind.files();
  const std::filesystem::path folder = kind.folder();
  const std::filesystem::path a = folder / "a.txt";
  const std::filesystem::path b = folder / "b.txt";

  void write(const std::filesystem::path& path, std::string_view text) {
    files.create(path, Existing::replace)->write(text);
  }
};

using Kinds = testing::Types<OnDisk, InMemory>;
TYPED_TEST_SUITE(FilesTest, Kinds);

TYPED_TEST(FilesTest, ReadsAnOpenFilePieceByPiece) {
  this->files.create(this->a, Existing::refuse)->write("abcdefg");
  const auto file = this->files.open(this->a);
  EXPECT_EQ(file->size(), 7U);
  std::byte piece[4] = {};
  EXPECT_EQ(file->read(piece), 4U);
  EXPECT_EQ(static_cast<char>(piece[3]), 'd');
  EXPECT_EQ(file->read(piece), 3U) << "the rest";
  EXPECT_EQ(static_cast<char>(piece[0]), 'e');
  EXPECT_EQ(file->read(piece), 0U) << "the end";
  expectError([&] { this->files.open(this->folder / "absent"); }, ENOENT, (this->folder / "absent").string());
}

TYPED_TEST(FilesTest, KeepsWhatIsAppended) {
  const auto file = this->files.create(this->a, Existing::refuse);
  file->write("one ");
  EXPECT_EQ(textOf(this->files, this->a), "one ") << "readable while the file is open";
  file->write("");
  file->write("two");
  file->sync();
  EXPECT_EQ(textOf(this->files, this->a), "one two");
}

TYPED_TEST(FilesTest, KeepsLargeAndBinaryContent) {
  std::vector<std::byte> content(300'000);
  for (std::size_t i = 0; i < content.size(); ++i) content[i] = static_cast<std::byte>(i * 7);
  this->files.create(this->a, Existing::refuse)->write(content);
  EXPECT_EQ(this->files.read(this->a), content);
}

TYPED_TEST(FilesTest, RefusesOrReplacesWhatIsThere) {
  this->write(this->a, "a long content");
  expectError([&] { this->files.create(this->a, Existing::refuse); }, EEXIST, this->a);
  EXPECT_EQ(textOf(this->files, this->a), "a long content");
  this->write(this->a, "short");
  EXPECT_EQ(textOf(this->files, this->a), "short");
}

TYPED_TEST(FilesTest, NamesThePathOfWhatIsAbsent) {
  const std::filesystem::path lost = this->folder / "no folder" / "a.txt";
  expectError([&] { this->files.read(this->a); }, ENOENT, this->a);
  expectError([&] { this->files.create(lost, Existing::replace); }, ENOENT, lost);
  expectError([&] { this->files.rename(this->a, this->b); }, ENOENT, this->a);
  expectError([&] { this->files.create(this->folder, Existing::replace); }, EISDIR, this->folder);
  expectError([&] { this->files.create(this->folder, Existing::refuse); }, EISDIR, this->folder);
  expectError([&] { this->files.read(this->folder); }, EISDIR, this->folder);
}

TYPED_TEST(FilesTest, RenamesOverWhatIsThere) {
  this->write(this->a, "new");
  this->write(this->b, "old");
  this->files.rename(this->a, this->b);
  EXPECT_EQ(textOf(this->files, this->b), "new");
  expectError([&] { this->files.read(this->a); }, ENOENT, this->a);
}

TYPED_TEST(FilesTest, AnOpenFileFollowsItsRename) {
  const auto file = this->files.create(this->a, Existing::refuse);
  file->write("before ");
  this->files.rename(this->a, this->b);
  file->write("after");
  EXPECT_EQ(textOf(this->files, this->b), "before after");
}

TYPED_TEST(FilesTest, RemovesWhatIsThereOrNot) {
  this->write(this->a, "x");
  this->files.remove(this->a);
  this->files.remove(this->a);
  EXPECT_THAT(this->files.list(this->folder), IsEmpty());
}

TYPED_TEST(FilesTest, ListsFilesByName) {
  EXPECT_THAT(this->files.list(this->folder), IsEmpty());
  EXPECT_THAT(this->files.list(this->folder / "absent"), IsEmpty());
  this->write(this->b, "");
  this->write(this->a, "");
  this->files.createFolder(this->folder / "below" / "it");
  this->write(this->folder / "below" / "c.txt", "");
  EXPECT_THAT(this->files.list(this->folder), ElementsAre("a.txt", "b.txt"))
      << "neither folders nor what is in them";
}

TYPED_TEST(FilesTest, CreatesFoldersOnceOrTwice) {
  const std::filesystem::path deep = this->folder / "one" / "two" / "three";
  this->files.createFolder(deep);
  this->files.createFolder(deep);
  this->write(deep / "a.txt", "x");
  EXPECT_EQ(textOf(this->files, deep / "a.txt"), "x");
  expectError([&] { this->files.createFolder(deep / "a.txt" / "four"); }, ENOTDIR, deep);
}

// What a server keeps there is not for others to replace, whatever the umask of its user.
TEST(SystemFiles, LetsNobodyElseWriteIntoFolders) {
  const OnDisk disk;
  const mode_t before = umask(0);
  SystemFiles().createFolder(disk.folder() / "one" / "two");
  umask(before);
  for (const char* each : {"one", "one/two"}) {
    EXPECT_EQ(std::filesystem::status(disk.folder() / each).permissions(), std::filesystem::perms(0755))
        << each;
  }
}

// Of mkdir(), not of the look for a folder that follows.
TEST(SystemFiles, SaysWhyAFolderCannotBeCreated) {
  const char* const refused = "/sys/hapticd_test";
  if (mkdir(refused, 0755) == 0) {
    rmdir(refused);
    GTEST_SKIP() << "/sys lets folders in";
  }
  const int reason = errno;
  expectError([&] { SystemFiles().createFolder(refused); }, reason, refused);
}

// Linux has one file that is always full.
TEST(SystemFiles, NamesThePathOfAFullDisk) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  SystemFiles files;
  const auto file = files.create("/dev/full", Existing::replace);
  expectError([&] { file->write("x"); }, ENOSPC, "/dev/full");
  expectError([&] { file->sync(); }, EINVAL, "/dev/full");
}

// As somebody who mistypes a path, or means the server ill, may name them: reading them whole takes all
// memory.
TEST(SystemFiles, DoesNotReadWithoutEnd) {
  SystemFiles files;
  expectError([&] { files.read("/dev/zero"); }, EFBIG, "/dev/zero");
  const OnDisk disk;
  const std::filesystem::path large = disk.folder() / "large";
  files.create(large, Existing::refuse);
  std::filesystem::resize_file(large, (std::uintmax_t{1} << 30U) + 1);  // takes no room on the disk
  expectError([&] { files.read(large); }, EFBIG, large);
}

TEST(FakeFiles, AFullDiskTakesWhatFits) {
  FakeFiles files;
  files.freeBytes = 5;
  const auto file = files.create("a", Existing::refuse);
  file->write("abc");
  expectError([&] { file->write("defg"); }, ENOSPC, "a");
  EXPECT_EQ(files.text("a"), "abcde");
  expectError([&] { file->write("h"); }, ENOSPC, "a");
  files.create("b", Existing::refuse)->write("");  // an empty file always fits
  files.remove("a");
  files.create("b", Existing::replace)->write("12345");
  EXPECT_EQ(files.text("b"), "12345");
  EXPECT_EQ(files.freeBytes, 0U);
}

TEST(FakeFiles, FailAsTold) {
  FakeFiles files;
  const auto file = files.create("a", Existing::refuse);
  files.failures = {.open = EACCES, .write = EIO, .sync = EIO, .rename = EXDEV};
  expectError([&] { files.create("b", Existing::refuse); }, EACCES, "b");
  EXPECT_FALSE(files.exists("b"));
  expectError([&] { files.read("a"); }, EACCES, "a");
  expectError([&] { file->write("x"); }, EIO, "a");
  expectError([&] { file->sync(); }, EIO, "a");
  EXPECT_EQ(files.syncs("a"), 0);
  expectError([&] { files.rename("a", "b"); }, EXDEV, "a");
  EXPECT_TRUE(files.exists("a"));
  files.failures = {};
  file->write("x");
  file->sync();
  files.rename("a", "b");
  EXPECT_EQ(files.text("b"), "x");
  EXPECT_EQ(files.syncs("b"), 1);
}

TEST(FakeFiles, ALossOfPowerKeepsWhatWasSynced) {
  FakeFiles files;
  const auto file = files.create("a", Existing::refuse);
  file->write("safe");
  file->sync();
  file->write(" lost");
  EXPECT_EQ(files.text("a"), "safe lost");
  files.losePower();
  EXPECT_EQ(files.text("a"), "safe");
}

}  // namespace
}  // namespace hapticd::base
