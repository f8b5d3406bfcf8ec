#include "mesh_io/confined_process.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "base/world.h"

namespace hapticd::mesh_io {
namespace {

using base::Nanos;

constexpr int kFailed = 3;  // exit status of a child whose output is the text of an error
constexpr std::size_t kLongestText = 300;
constexpr std::size_t kChunk = 1U << 20U;

// ---- In the child ----

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;  // no filter: the network namespace must do
#endif

// Memory, reading files, time, and an orderly or disorderly end.
constexpr std::uint32_t kAllowedCalls[] = {
    __NR_read,
    __NR_pread64,
    __NR_readv,
    __NR_write,
    __NR_writev,
    __NR_close,
    __NR_lseek,
    __NR_fstat,
    __NR_newfstatat,
    __NR_statx,
    __NR_faccessat,
    __NR_faccessat2,
    __NR_readlinkat,
    __NR_getdents64,
    __NR_getcwd,
    __NR_fadvise64,
    __NR_mmap,
    __NR_munmap,
    __NR_mremap,
    __NR_mprotect,
    __NR_madvise,
    __NR_brk,
    __NR_futex,
    __NR_rt_sigaction,
    __NR_rt_sigprocmask,
    __NR_rt_sigreturn,
    __NR_sigaltstack,
    __NR_getpid,
    __NR_gettid,
    __NR_getuid,
    __NR_geteuid,
    __NR_getgid,
    __NR_getegid,
    __NR_clock_gettime,
    __NR_clock_nanosleep,
    __NR_nanosleep,
    __NR_gettimeofday,
    __NR_getrandom,
    __NR_uname,
    __NR_sysinfo,
    __NR_getrusage,
    __NR_sched_yield,
    __NR_sched_getaffinity,
    __NR_restart_syscall,
    __NR_exit,
    __NR_exit_group,
#if defined(__x86_64__)
    __NR_stat,
    __NR_lstat,
    __NR_access,
    __NR_readlink,
    __NR_time,
    __NR_arch_prctl,
#endif
#ifdef HAPTICD_SANITIZED
    __NR_pipe2,  // UBSan looks at the memory of an exception through a pipe
#endif
};

class Filter {
 public:
  Filter() {
    load(offsetof(seccomp_data, arch));
    add(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0);
    end(SECCOMP_RET_KILL_PROCESS);
    load(offsetof(seccomp_data, nr));
    for (const std::uint32_t call : kAllowedCalls) {
      add(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 1);
      end(SECCOMP_RET_ALLOW);
    }
    allowReading(__NR_openat, 2);
#if defined(__x86_64__)
    allowReading(__NR_open, 1);
#endif
    // Not those that let a descriptor send signals; and no ioctl(), which can type into a terminal.
    for (const std::uint32_t command : {F_DUPFD, F_DUPFD_CLOEXEC, F_GETFD, F_SETFD, F_GETFL})
      allowWith(__NR_fcntl, 1, command);
    allowWith(__NR_tgkill, 0, static_cast<std::uint32_t>(getpid()));  // abort()
    end(SECCOMP_RET_ERRNO | EPERM);
  }

  bool install() {
    const sock_fprog program{static_cast<unsigned short>(steps_.size()), steps_.data()};
    return prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
  }

 private:
  void add(int code, std::uint32_t k, std::uint8_t yes = 0, std::uint8_t no = 0) {
    steps_.push_back({static_cast<std::uint16_t>(code), yes, no, k});
  }
  void load(std::size_t offset) {
    add(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
  }
  void end(std::uint32_t result) {
    add(BPF_RET | BPF_K, result);
  }
  // The lower half of an argument; both architectures are little-endian.
  void loadArgument(std::size_t number) {
    load(offsetof(seccomp_data, args) + 8 * number);
  }

  void allowReading(std::uint32_t call, std::size_t flags) {
    add(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 4);
    loadArgument(flags);
    add(BPF_JMP | BPF_JSET | BPF_K, O_ACCMODE | O_CREAT | O_TRUNC | O_APPEND, 1, 0);
    end(SECCOMP_RET_ALLOW);
    end(SECCOMP_RET_ERRNO | EACCES);
  }
  // With this value of an argument.
  void allowWith(std::uint32_t call, std::size_t argument, std::uint32_t value) {
    add(BPF_JMP | BPF_JEQ | BPF_K, call, 0, 4);
    loadArgument(argument);
    add(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1);
    end(SECCOMP_RET_ALLOW);
    load(offsetof(seccomp_data, nr));
  }

  std::vector<sock_filter> steps_;
};

void limit(__rlimit_resource resource, std::uint64_t value) {
  rlimit now{};
  getrlimit(resource, &now);
  now.rlim_cur = now.rlim_max = std::min<rlim_t>(now.rlim_max, value);
  setrlimit(resource, &now);
}

// Standard input at its end; standard output and error without a reader.
void closeEverythingExcept(int& output) {
  int empty[2];
  int nowhere[2];
  if (pipe(empty) != 0 || pipe(nowhere) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  output = fcntl(output, F_DUPFD, 3);  // above what is replaced next
  dup2(empty[0], STDIN_FILENO);
  dup2(nowhere[1], STDOUT_FILENO);
  dup2(nowhere[1], STDERR_FILENO);
  output = dup2(output, 3);
  close_range(4, ~0U, 0);
}

void confine(const ConfinedLimits& limits, std::uint64_t mapped_bytes, int& output) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  sigset_t none;
  sigemptyset(&none);
  pthread_sigmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) std::signal(signal, SIG_DFL);
  std::signal(SIGPIPE, SIG_IGN);
  closeEverythingExcept(output);
  setsid();  // no terminal
  prctl(PR_SET_DUMPABLE, 0);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);

  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_NOFILE, 32);
  limit(RLIMIT_STACK, 8U << 20U);  // endless recursion would fill an unlimited one
  limit(RLIMIT_CPU, static_cast<std::uint64_t>(std::ceil(limits.time_s)));
#ifndef HAPTICD_SANITIZED
  limit(RLIMIT_AS, mapped_bytes + limits.memory_bytes);
#else
  static_cast<void>(mapped_bytes);
#endif

  // An unprivileged process needs a user namespace for a network namespace.
  const bool separated =
      limits.networkNamespace && (unshare(CLONE_NEWNET) == 0 || unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0);
  const bool filtered = limits.systemCallFilter && kArchitecture != 0 && Filter().install();
  if (!separated && !filtered) {
    throw ConfinedError(
        "foreign files are not read on this machine, because neither a network namespace nor a seccomp "
        "filter can be set up: allow one of them");
  }
}

bool sendAll(int output, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::write(output, bytes.data(), std::min(bytes.size(), kChunk));
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

std::string memoryText(const ConfinedLimits& limits) {
  return "reading it takes more than " + std::to_string(limits.memory_bytes >> 20U) + " MiB of memory";
}

[[noreturn]] void runChild(const ConfinedLimits& limits, std::uint64_t mapped_bytes, int output,
                           const std::function<void(const ConfinedOutput&)>& work) {
  std::string failure;
  try {
    confine(limits, mapped_bytes, output);
    work([&](std::span<const std::byte> bytes) {
      if (!sendAll(output, bytes)) _exit(kFailed);  // nobody reads
    });
    _exit(0);
  } catch (const std::bad_alloc&) {
    failure = memoryText(limits);
  } catch (const std::exception& error) {
    failure = error.what();
  }
  sendAll(output, std::as_bytes(std::span(failure)));
  _exit(kFailed);
}

// ---- In the calling process ----

std::string timeText(const ConfinedLimits& limits) {
  char text[64];
  std::snprintf(text, sizeof text, "reading it takes longer than %.3g s", limits.time_s);
  return text;
}

std::uint64_t mappedBytes() {
  std::uint64_t pages = 0;
  const std::vector<std::byte> text = base::SystemFiles().read("/proc/self/statm");
  for (const std::byte c : text) {
    if (c < std::byte{'0'} || c > std::byte{'9'}) break;
    pages = 10 * pages + static_cast<std::uint64_t>(c) - '0';
  }
  return pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::string printable(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte b : bytes.first(std::min(bytes.size(), kLongestText))) {
    const char c = static_cast<char>(b);
    text += c >= ' ' && c <= '~' ? c : ' ';
  }
  return text;
}

// A child whose end is awaited; killed when it has not ended by itself.
class Child {
 public:
  explicit Child(pid_t process) : process_(process) {}
  ~Child() { kill(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void kill() {
    if (process_ < 0) return;
    ::kill(process_, SIGKILL);
    while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
    }
    process_ = -1;
  }
  // Whether it ended before this time; then with this status.
  bool endsBefore(Nanos deadline, int& status) {
    for (;;) {
      const pid_t ended = waitpid(process_, &status, WNOHANG);
      if (ended == process_) {
        process_ = -1;
        return true;
      }
      if (ended < 0 && errno != EINTR) throw std::system_error(errno, std::generic_category(), "waitpid");
      if (base::now() >= deadline) return false;
      base::sleepFor(1'000'000);
    }
  }

 private:
  pid_t process_;
};

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }

 private:
  int number_;
};

// All that the child sends. Throws ConfinedError at a limit.
std::vector<std::byte> receive(int input, const ConfinedLimits& limits, Nanos deadline) {
  std::vector<std::byte> bytes;
  for (;;) {
    const Nanos left = deadline - base::now();
    if (left <= 0) throw ConfinedError(timeText(limits));
    pollfd readable{input, POLLIN, 0};
    if (poll(&readable, 1, static_cast<int>(std::min<Nanos>(left / 1'000'000 + 1, 1000))) <= 0) continue;
    const std::size_t have = bytes.size();
    bytes.resize(have + kChunk);
    const ssize_t got = read(input, bytes.data() + have, kChunk);
    bytes.resize(have + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw std::system_error(errno, std::generic_category(), "read");
    if (got == 0) return bytes;
    if (bytes.size() > limits.output_bytes) {
      throw ConfinedError("its content takes more than " + std::to_string(limits.output_bytes >> 20U) +
                          " MiB");
    }
  }
}

}  // namespace

std::vector<std::byte> runConfined(const ConfinedLimits& limits,
                                   const std::function<void(const ConfinedOutput&)>& work) {
  const std::uint64_t mapped_bytes = mappedBytes();
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    throw ConfinedError(std::string("no pipe to a child process: ") + std::strerror(errno));
  const Descriptor input(ends[0]);
  Descriptor output(ends[1]);
  const Nanos deadline = base::now() + base::toNanos(limits.time_s);
  const pid_t process = fork();
  if (process < 0) throw ConfinedError(std::string("no child process: ") + std::strerror(errno));
  if (process == 0) runChild(limits, mapped_bytes, output.number(), work);
  Child child(process);
  output.close();

  std::vector<std::byte> bytes = receive(input.number(), limits, deadline);
  int status = 0;
  if (!child.endsBefore(std::max(deadline, base::now() + 1'000'000'000), status))
    throw ConfinedError("its reader does not end");
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) throw ConfinedError(timeText(limits));
  if (WIFSIGNALED(status))
    throw ConfinedError(std::string("its reader crashed (") + strsignal(WTERMSIG(status)) + ")");
  if (WEXITSTATUS(status) == 0) return bytes;
  throw ConfinedError(bytes.empty() ? "its reader failed without a reason" : printable(bytes));
}

}  // namespace hapticd::mesh_io
