// Files behind an interface, so that a test can fill the disk or fail an fsync.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace hapticd::base {

/// A file open for writing; the destructor closes it. One thread at a time. On failure every call throws
/// std::system_error with the path and the reason.
class OutputFile {
 public:
  virtual ~OutputFile() = default;
  /// Appends all bytes. After an error, some of them may have been written.
  virtual void write(std::span<const std::byte> bytes) = 0;
  /// Returns when all written bytes are on the disk.
  virtual void sync() = 0;
  /// Whether it was removed, or another program changed its size: what is written is lost, or follows other
  /// bytes. A file that was renamed is not. Does not throw.
  virtual bool isGone() const noexcept = 0;

  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
};

/// A file open for reading, closed by its destructor. One thread at a time.
class InputFile {
 public:
  virtual ~InputFile() = default;
  /// Bytes from the start to the end when it was opened.
  virtual std::uint64_t size() const = 0;
  /// Fills `into` from the current position on and returns how many bytes it got: fewer only at the end.
  /// Throws std::system_error with the path and the system's reason.
  virtual std::size_t read(std::span<std::byte> into) = 0;
};

/// What create() does with an existing file.
enum class Existing { refuse, replace };

/// On failure every call throws std::system_error with the path and the reason. From any thread.
class Files {
 public:
  virtual ~Files() = default;
  /// Creates a file (mode 0644) for writing. Its folder must exist.
  virtual std::unique_ptr<OutputFile> create(const std::filesystem::path& path, Existing existing) = 0;
  /// Opens a file for reading from its start.
  virtual std::unique_ptr<InputFile> open(const std::filesystem::path& path) = 0;
  /// The whole content, at most 1 GiB of a file and 64 MiB of a pipe or a device (std::errc::file_too_large).
  virtual std::vector<std::byte> read(const std::filesystem::path& path) = 0;
  /// Replaces `to`; atomic. Both must be in one file system.
  virtual void rename(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  /// Not an error when the file is absent.
  virtual void remove(const std::filesystem::path& path) = 0;
  /// Creates a folder and its parents; not an error when it exists.
  virtual void createFolder(const std::filesystem::path& path) = 0;
  /// Sorted names of the regular files in a folder; empty when the folder does not exist.
  virtual std::vector<std::string> list(const std::filesystem::path& folder) = 0;
};

/// The files of the machine.
class SystemFiles final : public Files {
 public:
  std::unique_ptr<OutputFile> create(const std::filesystem::path& path, Existing existing) override;
  std::unique_ptr<InputFile> open(const std::filesystem::path& path) override;
  std::vector<std::byte> read(const std::filesystem::path& path) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& path) override;
  void createFolder(const std::filesystem::path& path) override;
  std::vector<std::string> list(const std::filesystem::path& folder) override;
};

}  // namespace hapticd::base
