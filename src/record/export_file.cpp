#include "record/export_file.h"

#include <system_error>

#include "base/world.h"
#include "record/recording.h"

namespace hapticd::record {
namespace {

constexpr std::size_t kFlushAt = 64 * 1024;

}  // namespace

ExportFile::ExportFile(const std::filesystem::path& path) : path_(path) {
  try {
    file_ = base::world().files.create(path, base::Existing::replace);
  } catch (const std::system_error& error) {
    throw RecordingError("cannot write '" + path_.string() + "': " + error.code().message() +
                         "; name a file in a directory that can be written");
  }
}

ExportFile::~ExportFile() {
  try {
    close();
  } catch (const RecordingError&) {
    // Whoever needs the file whole calls close().
  }
}

void ExportFile::write(ByteView bytes) {
  pending_.insert(pending_.end(), bytes.begin(), bytes.end());
  if (pending_.size() >= kFlushAt) flush();
}

void ExportFile::flush() {
  const Bytes bytes = std::exchange(pending_, {});
  try {
    file_->write(bytes);
  } catch (const std::system_error& error) {
    throw RecordingError("writing '" + path_.string() + "' failed: " + error.code().message() +
                         "; make room on the disk");
  }
}

void ExportFile::close() {
  if (!file_) return;
  flush();
  file_.reset();
}

}  // namespace hapticd::record
