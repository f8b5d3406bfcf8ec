// Arithmetic on denormal numbers costs hundreds of cycles, and forces that small cannot be felt.
#pragma once

#include <cstdint>
#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace hapticd::realtime {

/// While it lives, this thread flushes denormal results and inputs to zero. Two register writes.
class FlushDenormals {
 public:
#if defined(__SSE2__)
  static constexpr bool kSupported = true;
  FlushDenormals() noexcept : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | 0x8040U);
  }  // FTZ | DAZ
  ~FlushDenormals() {
    _mm_setcsr(before_);
  }

 private:
  std::uint32_t before_;
#elif defined(__aarch64__)
  static constexpr bool kSupported = true;
  FlushDenormals() noexcept {
    asm volatile("mrs %0, fpcr" : "=r"(before_));
    asm volatile("msr fpcr, %0" ::"r"(before_ | (std::uint64_t{1} << 24)));
  }
  ~FlushDenormals() {
    asm volatile("msr fpcr, %0" ::"r"(before_));
  }

 private:
  std::uint64_t before_;
#else
  static constexpr bool kSupported = false;
#endif

 public:
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;
};

}  // namespace hapticd::realtime
