#include "device/dynamic_library.h"

#include <cstdlib>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

namespace hapticd::device {
namespace {

#ifdef _WIN32

void* load(const char* name) {
  const bool isPath = std::string(name).find_first_of("\\/") != std::string::npos;
  return LoadLibraryExA(name, nullptr, isPath ? 0 : LOAD_LIBRARY_SEARCH_DEFAULT_DIRS);
}

std::string loadersWords(const char* name) {
  return std::string(name) + ": Windows error " + std::to_string(GetLastError());
}

#else

// RTLD_NOW: a missing dependency shows here and not later, in use. RTLD_LOCAL: two vendors may export the
// same names.
void* load(const char* name) {
  return dlopen(name, RTLD_NOW | RTLD_LOCAL);
}

std::string loadersWords(const char* name) {
  const char* words = dlerror();
  return words != nullptr ? words : std::string(name) + ": no reason given";
}

// Its code runs with all rights of this process: a file that other users can change is refused. Empty: none
// is.
std::string objectionTo(const std::string& file) {
  if (!file.starts_with('/')) return file + ": not an absolute path";
  struct stat found {};
  if (stat(file.c_str(), &found) != 0) return {};  // the loader has the words
  if (found.st_uid != 0 && found.st_uid != geteuid())
    return file + ": belongs to another user; make root its owner";
  // The private group of the user has no other members.
  const bool ownGroup = found.st_gid == 0 || (found.st_gid == getegid() && found.st_gid == geteuid());
  if ((found.st_mode & S_IWGRP) != 0 && !ownGroup)
    return file + ": all of its group may change it; chmod g-w";
  if ((found.st_mode & S_IWOTH) != 0) return file + ": every user may change it; chmod o-w";
  return {};
}

#endif

}  // namespace

DynamicLibrary::DynamicLibrary(const LibraryNames& names) {
#ifdef _WIN32
  const auto& usual = names.windowsNames;
  const char* chosen = std::getenv(names.environment);
#else
  const auto& usual = names.unixNames;
  // Not for a program with more rights than its user, such as file capabilities: the library would get them.
  const char* chosen = secure_getenv(names.environment);
#endif
  std::vector<std::string> candidates;
  if (chosen != nullptr && *chosen != '\0') {
#ifndef _WIN32
    const std::string objection = objectionTo(chosen);
    if (!objection.empty()) throw LibraryError(objection + " (" + names.environment + ")");
#endif
    candidates.emplace_back(chosen);
  } else {
    candidates.assign(usual.begin(), usual.end());
  }

  std::string words;
  for (const std::string& candidate : candidates) {
    handle_ = load(candidate.c_str());
    if (handle_ != nullptr) {
      name_ = candidate;
      return;
    }
    words += (words.empty() ? "" : "; ") + loadersWords(candidate.c_str());
  }
  throw LibraryError(words + " (" + names.environment + " can name the file)");
}

void DynamicLibrary::complain() const {
  if (missing_.empty()) return;
  std::string list;
  for (const std::string& symbol : missing_) list += (list.empty() ? "" : ", ") + symbol;
  throw LibraryError(name_ + " is not the library it should be: it has no " + list);
}

void* DynamicLibrary::find(const char* symbol) const noexcept {
#ifdef _WIN32
  return reinterpret_cast<void*>(GetProcAddress(static_cast<HMODULE>(handle_), symbol));
#else
  return dlsym(handle_, symbol);
#endif
}

}  // namespace hapticd::device
