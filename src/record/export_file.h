// A file for other programs: written in large pieces, with errors that name a remedy.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "base/files.h"
#include "record/archive.h"

namespace hapticd::record {

/// Collects small writes. Every call throws RecordingError when the file cannot be written.
class ExportFile {
 public:
  /// Creates the file or replaces it.
  explicit ExportFile(const std::filesystem::path& path);
  /// Writes what close() did not write, and ignores errors.
  ~ExportFile();
  ExportFile(const ExportFile&) = delete;
  ExportFile& operator=(const ExportFile&) = delete;

  void write(ByteView bytes);
  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
  /// Writes what is left and closes the file. Idempotent.
  void close();

 private:
  void flush();

  const std::filesystem::path path_;
  std::unique_ptr<base::OutputFile> file_;
  Bytes pending_;
};

}  // namespace hapticd::record
