// Files, behind an interface: a simulated world can fill the disk and fail an fsync.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace hapticd::base {

/// A file open for writing, closed by its destructor. One thread at a time. Every call throws std::system_error with the
/// path and the system's reason.
class OutputFile {
 public:
  virtual ~OutputFile() = default;
  /// Appends all bytes.
  virtual void write(std::span<const std::byte> bytes) = 0;
  /// Returns when what was written is on the disk.
  virtual void sync() = 0;

  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
};

/// What may be there already when a file is created.
enum class Existing { refuse, replace };

/// Every call throws std::system_error with the path and the system's reason.
class Files {
 public:
  virtual ~Files() = default;
  /// Creates a file (mode 0644) for writing.
  virtual std::unique_ptr<OutputFile> create(const std::filesystem::path& path, Existing existing) = 0;
  /// The whole content.
  virtual std::vector<std::byte> read(const std::filesystem::path& path) = 0;
  /// Atomic where both are in one file system; replaces `to`.
  virtual void rename(const std::filesystem::path& from, const std::filesystem::path& to) = 0;
  /// Not an error when the file is absent.
  virtual void remove(const std::filesystem::path& path) = 0;
  /// Creates a folder and its parents; not an error when it exists.
  virtual void createFolder(const std::filesystem::path& path) = 0;
  /// Names of the regular files in a folder, sorted; none when the folder is absent.
  virtual std::vector<std::string> list(const std::filesystem::path& folder) = 0;
};

/// The file systems of the machine.
class SystemFiles final : public Files {
 public:
  std::unique_ptr<OutputFile> create(const std::filesystem::path& path, Existing existing) override;
  std::vector<std::byte> read(const std::filesystem::path& path) override;
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override;
  void remove(const std::filesystem::path& path) override;
  void createFolder(const std::filesystem::path& path) override;
  std::vector<std::string> list(const std::filesystem::path& folder) override;
};

}  // namespace hapticd::base
