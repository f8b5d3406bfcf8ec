#include "record/export_file.h"

#include <system_error>

#include "base/world.h"
#include "record/recording.h"

namespace hapticd::record {
namespace {

constexpr std::size_t kFlushAt = 64 * 1024;
constexpr int kMostLinks = 40;  // as the kernel follows
constexpr int kMostNames = 100;

}  // namespace

ExportFile::ExportFile(const std::filesystem::path& path, Unfinished unfinished)
    : path_(path), unfinished_(unfinished), target_(path), written_(path) {
  namespace fs = std::filesystem;
  std::error_code none;
  const fs::file_type type = fs::status(path, none).type();
  const fs::file_type entry = fs::symlink_status(path, none).type();
  isPlain_ = entry == fs::file_type::regular || entry == fs::file_type::not_found;
  const bool isNew = type == fs::file_type::not_found;
  if (type == fs::file_type::regular || (isNew && unfinished == Unfinished::dropped)) {
    createBeside();
  } else {
    create(base::Existing::replace);
  }
}

void ExportFile::createBeside() {
  namespace fs = std::filesystem;
  std::error_code none;
  for (int link = 0; link < kMostLinks && fs::is_symlink(target_, none); ++link)
    target_ = target_.parent_path() / fs::read_symlink(target_, none);
  // Of another program, or of one that was killed.
  for (int number = 1; !file_; ++number) {
    written_ = target_;
    written_ += number == 1 ? ".part" : ".part" + std::to_string(number);
    if (number < kMostNames && fs::exists(fs::symlink_status(written_, none))) continue;
    create(base::Existing::refuse);
  }
}

void ExportFile::create(base::Existing existing) {
  try {
    file_ = base::world().files.create(written_, existing);
  } catch (const std::system_error& error) {
    failToCreate(error.code());
  }
}

void ExportFile::failToCreate(const std::error_code& why) const {
  throw RecordingError("cannot write '" + path_.string() + "': " + why.message() +
                       "; name a file in a directory that can be written");
}

void ExportFile::removeEmpty() const noexcept {
  base::Files& files = base::world().files;
  try {
    if (files.open(written_)->size() == 0) files.remove(written_);
  } catch (const std::exception&) {
    // It is gone, or stays.
  }
}

// It cannot report an error: callers that need the file whole call close().
ExportFile::~ExportFile() {
  if (!file_) return;
  const bool isKept = unfinished_ == Unfinished::kept || written_ == target_;
  try {
    if (isKept && !failed_) close();
  } catch (const std::exception&) {
    failed_ = true;
  }
  file_.reset();
  try {
    if (written_ != target_) base::world().files.remove(written_);
  } catch (const std::exception&) {
    // It stays.
  }
  if (failed_ && isPlain_) removeEmpty();
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
    failed_ = true;
    throw RecordingError("writing '" + path_.string() + "' failed: " + error.code().message() +
                         "; make room on the disk");
  }
  if (unfinished_ == Unfinished::kept) takeName();
}

void ExportFile::takeName() {
  if (written_ == target_) return;
  try {
    base::world().files.rename(written_, target_);
  } catch (const std::system_error& error) {
    failToCreate(error.code());
  }
  written_ = target_;
}

void ExportFile::close() {
  if (!file_) return;
  flush();
  takeName();
  file_.reset();
}

}  // namespace hapticd::record
