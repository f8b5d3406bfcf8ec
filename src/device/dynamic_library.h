// Vendor libraries, found when the program runs: none of them is needed to build or to start it.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace hapticd::device {

/// A library that cannot be used; the text holds the system loader's own words for every name tried.
class LibraryError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where a library may be: the file in an environment variable alone, if that is set, otherwise these names
/// in order.
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

  /// Binds a function that may be missing: null then.
  template <class Function>
  void bindOptional(Function*& function, const char* symbol) const noexcept {
    function = reinterpret_cast<Function*>(find(symbol));
  }
  /// Binds a function that must be there; complain() tells of those that are not.
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
