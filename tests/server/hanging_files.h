// A disk that answers when the test says so.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/files.h"

namespace hapticd::test {

class HangingFiles final : public base::Files {
 public:
  std::unique_ptr<base::OutputFile> create(const std::filesystem::path& path,
                                           base::Existing existing) override {
    asked_ = true;
    hangs_.wait(true);
    return real_.create(path, existing);
  }
  std::unique_ptr<base::InputFile> open(const std::filesystem::path& path) override {
    return real_.open(path);
  }
  std::vector<std::byte> read(const std::filesystem::path& path) override { return real_.read(path); }
  void rename(const std::filesystem::path& from, const std::filesystem::path& to) override {
    real_.rename(from, to);
  }
  void remove(const std::filesystem::path& path) override { real_.remove(path); }
  void createFolder(const std::filesystem::path& path) override { real_.createFolder(path); }
  std::vector<std::string> list(const std::filesystem::path& path) override { return real_.list(path); }
  /// Whether a file was to be created.
  bool asked() const { return asked_; }
  void answer() {
    hangs_ = false;
    hangs_.notify_all();
  }

 private:
  base::SystemFiles real_;
  std::atomic<bool> asked_{false};
  std::atomic<bool> hangs_{true};
};

}  // namespace hapticd::test
