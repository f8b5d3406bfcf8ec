// Vendor libraries, loaded at run time: neither the build nor the start of the program needs them.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace hapticd::device {

/// A library that cannot be used; the text holds the system loader's message for every name tried.
class LibraryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where to look for a library: only the file that an environment variable names, if it is set, otherwise
/// these names in order.
struct LibraryNames {
  const char* environment;
  std::vector<const char*> unixNames;
  std::vector<const char*> windowsNames;
};

/// One loaded library. It stays loaded until the process ends: vendor libraries leave threads and exit
/// handlers behind that would run into unmapped code. Not for the servo thread.
class DynamicLibrary {
 public:
  /// Loads the first name that loads. Throws LibraryError.
  explicit DynamicLibrary(const LibraryNames& names);

  /// The name or file that was loaded.
  const std::string& name() const noexcept { return name_; }

  /// Binds an optional function; null when it is missing.
  template <class Function>
  void bindOptional(Function*& function, const char* symbol) const noexcept {
    function = reinterpret_cast<Function*>(find(symbol));
  }
  /// Binds a required function; complain() reports the missing ones.
  template <class Function>
  void bind(Function*& function, const char* symbol) {
    bindOptional(function, symbol);
    if (function == nullptr) missing_.emplace_back(symbol);
  }
  /// Throws LibraryError with the names of all functions that bind() did not find. Before the first call into
  /// the library.
  void complain() const;

 private:
  void* find(const char* symbol) const noexcept;

  void* handle_ = nullptr;
  std::string name_;
  std::vector<std::string> missing_;
};

}  // namespace hapticd::device
