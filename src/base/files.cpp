#include "base/files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

namespace hapticd::base {
namespace {

// Of what is read whole. A device such as /dev/zero has no end.
constexpr std::uint64_t kMostOfAFile = 1U << 30U;
constexpr std::uint64_t kMostOfAStream = 1U << 26U;

[[noreturn]] void fail(int error, const std::string& what, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), what + " " + path.string());
}

class Descriptor {
 public:
  Descriptor(const std::filesystem::path& path, int flags)
      : path_(path), fd_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {
    if (fd_ < 0) fail(errno, "cannot open", path_);
  }
  ~Descriptor() { ::close(fd_); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }
  int fd() const noexcept { return fd_; }

 private:
  const std::filesystem::path path_;
  const int fd_;
};

class SystemOutputFile final : public OutputFile {
 public:
  // Appends, so that a file whose size another program changed keeps another size than what was written.
  SystemOutputFile(const std::filesystem::path& path, int flags)
      : file_(path, O_WRONLY | O_CREAT | O_APPEND | flags) {}

  void write(std::span<const std::byte> bytes) override {
    while (!bytes.empty()) {
      const ssize_t written = ::write(file_.fd(), bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(errno, "cannot write", file_.path());
      bytes = bytes.subspan(static_cast<std::size_t>(written));
      written_ += written;
    }
  }

  void sync() override {
    if (::fdatasync(file_.fd()) != 0) fail(errno, "cannot sync", file_.path());
  }

  bool isGone() const noexcept override {
    struct stat status {};
    if (::fstat(file_.fd(), &status) != 0) return false;
    return status.st_nlink == 0 || (S_ISREG(status.st_mode) && status.st_size != written_);
  }

 private:
  Descriptor file_;
  off_t written_ = 0;
};

// Reads until the span is full or the file ends.
std::size_t readFully(const Descriptor& file, std::span<std::byte> into) {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t got = ::read(file.fd(), into.data() + done, into.size() - done);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(errno, "cannot read", file.path());
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

class SystemInputFile final : public InputFile {
 public:
  explicit SystemInputFile(const std::filesystem::path& path)
      : file_(path, O_RDONLY), size_(std::filesystem::file_size(path)) {}

  std::uint64_t size() const override { return size_; }
  std::size_t read(std::span<std::byte> into) override { return readFully(file_, into); }

 private:
  Descriptor file_;
  std::uint64_t size_;
};

}  // namespace

std::unique_ptr<InputFile> SystemFiles::open(const std::filesystem::path& path) {
  return std::make_unique<SystemInputFile>(path);
}

std::unique_ptr<OutputFile> SystemFiles::create(const std::filesystem::path& path, Existing existing) {
  try {
    return std::make_unique<SystemOutputFile>(path, existing == Existing::refuse ? O_EXCL : O_TRUNC);
  } catch (const std::system_error& error) {
    // Of whatever is there, the kernel says EEXIST.
    std::error_code none;
    if (error.code() == std::errc::file_exists && std::filesystem::is_directory(path, none))
      fail(EISDIR, "cannot open", path);
    throw;
  }
}

std::vector<std::byte> SystemFiles::read(const std::filesystem::path& path) {
  const Descriptor file(path, O_RDONLY);
  struct stat status {};
  if (::fstat(file.fd(), &status) != 0) fail(errno, "cannot read", path);
  const std::uint64_t most = S_ISREG(status.st_mode) ? kMostOfAFile : kMostOfAStream;
  if (static_cast<std::uint64_t>(status.st_size) > most) fail(EFBIG, "cannot read", path);
  std::vector<std::byte> content;
  std::array<std::byte, 64 * 1024> piece;
  for (;;) {
    const std::size_t got = readFully(file, piece);
    content.insert(content.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
    if (content.size() > most) fail(EFBIG, "cannot read", path);
    if (got < piece.size()) return content;
  }
}

void SystemFiles::rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::filesystem::rename(from, to);
}

void SystemFiles::remove(const std::filesystem::path& path) {
  std::filesystem::remove(path);
}

// Unlike create_directories(), for nobody else to write into, whatever the umask.
void SystemFiles::createFolder(const std::filesystem::path& path) {
  std::error_code none;
  if (std::filesystem::is_directory(path, none)) return;
  if (path.has_relative_path() && path.has_parent_path()) createFolder(path.parent_path());
  if (::mkdir(path.c_str(), 0755) == 0) return;
  const int reason = errno;
  if (std::filesystem::is_directory(path, none)) return;
  fail(reason == EEXIST ? ENOTDIR : reason, "cannot create", path);
}

std::vector<std::string> SystemFiles::list(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  if (!std::filesystem::is_directory(folder)) return names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file()) names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace hapticd::base
