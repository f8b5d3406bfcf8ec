// Memory straight from the system.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <new>

namespace hapticd::base {

/// For large, short-lived containers: what they free goes back to the system at once. The heap keeps such
/// memory, and cannot give it back while the process has locked its memory (mlockall).
template <class T>
struct PageAllocator {
  using value_type = T;

  PageAllocator() noexcept = default;
  template <class Other>
  PageAllocator(const PageAllocator<Other>&) noexcept {
  }  // NOLINT(google-explicit-constructor): as allocators

  T* allocate(std::size_t count) {
    if (count > PTRDIFF_MAX / sizeof(T)) throw std::bad_array_new_length();
    void* const pages =
        ::mmap(nullptr, count * sizeof(T), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED) throw std::bad_alloc();
    return static_cast<T*>(pages);
  }
  void deallocate(T* pages, std::size_t count) noexcept { ::munmap(pages, count * sizeof(T)); }

  friend bool operator==(const PageAllocator&, const PageAllocator&) noexcept { return true; }
};

}  // namespace hapticd::base
