// A file for other programs: written in large pieces, with errors that name a remedy.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "base/files.h"
#include "record/archive.h"

namespace hapticd::record {

/// What becomes of a file that is not closed, because an error came first.
enum class Unfinished {
  kept,    ///< the file has what was written, if that is anything: for what cannot be made again. A file
           ///< that it replaces stays until the first bytes are written
  dropped  ///< there is none, and a file that it would have replaced stays as it was
};

/// Collects small writes. Every call throws RecordingError when the file cannot be written.
class ExportFile {
 public:
  /// Creates the file or replaces it: with Unfinished::kept by the first bytes, with Unfinished::dropped in
  /// close(). A pipe or device is written.
  explicit ExportFile(const std::filesystem::path& path, Unfinished unfinished = Unfinished::kept);
  /// Does with a file that was not closed what was chosen, and ignores errors.
  ~ExportFile();
  ExportFile(const ExportFile&) = delete;
  ExportFile& operator=(const ExportFile&) = delete;

  void write(ByteView bytes);
  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
  /// Writes what is left.
  void flush();
  /// The same, and closes the file, which then has its name. Idempotent.
  void close();

 private:
  void create(base::Existing existing);
  void createBeside();
  void takeName();
  void removeEmpty() const noexcept;
  [[noreturn]] void failToCreate(const std::error_code& why) const;

  const std::filesystem::path path_;
  const Unfinished unfinished_;
  std::filesystem::path target_;   // without a symbolic link, which a renaming would replace
  std::filesystem::path written_;  // a new one beside it until it takes the name, or the same
  bool isPlain_;                   // neither a link nor a device, which others made
  std::unique_ptr<base::OutputFile> file_;
  Bytes pending_;
  bool failed_ = false;  // to write
};

}  // namespace hapticd::record
