#include "realtime/servo/forbidden_calls.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstddef>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace hapticd::realtime::law {
namespace {

thread_local bool inside = false;
std::atomic<int> count{0};
std::atomic<const char*> first{""};
void* stack[40];
int depth = 0;

void note(const char* name) noexcept {
  if (!inside) return;
  inside = false;  // what backtrace() does is not the loop's fault
  if (count.fetch_add(1) == 0) {
    first = name;
    depth = backtrace(stack, 40);
  }
  inside = true;
}

template <class F>
F next(const char* name, const char* version = nullptr) noexcept {
  void* found = version != nullptr ? dlvsym(RTLD_NEXT, name, version) : dlsym(RTLD_NEXT, name);
  return reinterpret_cast<F>(found);
}

}  // namespace

void enter() noexcept {
  inside = true;
}
void leave() noexcept {
  inside = false;
}
int violations() noexcept {
  return count;
}
const char* firstViolation() noexcept {
  return first;
}
void printFirstViolation() noexcept {
  backtrace_symbols_fd(stack, depth, STDERR_FILENO);
}
void forget() noexcept {
  count = 0;
  first = "";
  depth = 0;
}

}  // namespace hapticd::realtime::law

namespace law = hapticd::realtime::law;

extern "C" {

void* malloc(std::size_t size) {
  law::note("malloc");
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  law::note("calloc");
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
  law::note("realloc");
  return __libc_realloc(memory, size);
}
void free(void* memory) {
  if (memory != nullptr) law::note("free");
  __libc_free(memory);
}
void* memalign(std::size_t alignment, std::size_t size) {
  law::note("memalign");
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  law::note("aligned_alloc");
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  law::note("posix_memalign");
  *memory = __libc_memalign(alignment, size);
  return *memory != nullptr ? 0 : ENOMEM;
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  law::note("pthread_mutex_lock");
  static const auto real = law::next<int (*)(pthread_mutex_t*)>("pthread_mutex_lock");
  return real(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  law::note("pthread_rwlock_rdlock");
  static const auto real = law::next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_rdlock");
  return real(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  law::note("pthread_rwlock_wrlock");
  static const auto real = law::next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_wrlock");
  return real(lock);
}
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  law::note("pthread_cond_wait");
  static const auto real =
      law::next<int (*)(pthread_cond_t*, pthread_mutex_t*)>("pthread_cond_wait", "GLIBC_2.3.2");
  return real(condition, mutex);
}
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  law::note("pthread_cond_timedwait");
  static const auto real = law::next<int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*)>(
      "pthread_cond_timedwait", "GLIBC_2.3.2");
  return real(condition, mutex, until);
}
int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const timespec* until) {
  law::note("pthread_cond_clockwait");
  static const auto real = law::next<int (*)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>(
      "pthread_cond_clockwait");
  return real(condition, mutex, clock, until);
}
int pthread_cond_signal(pthread_cond_t* condition) {
  law::note("pthread_cond_signal");
  static const auto real = law::next<int (*)(pthread_cond_t*)>("pthread_cond_signal", "GLIBC_2.3.2");
  return real(condition);
}
int pthread_cond_broadcast(pthread_cond_t* condition) {
  law::note("pthread_cond_broadcast");
  static const auto real = law::next<int (*)(pthread_cond_t*)>("pthread_cond_broadcast", "GLIBC_2.3.2");
  return real(condition);
}

// The standard library waits on atomics and semaphores by a direct futex call.
long syscall(long number, ...) {
  if (number == SYS_futex) law::note("futex");
  va_list list;
  va_start(list, number);
  long a[6];
  for (long& argument : a) argument = va_arg(list, long);
  va_end(list);
  static const auto real = law::next<long (*)(long, ...)>("syscall");
  return real(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

}  // extern "C"
