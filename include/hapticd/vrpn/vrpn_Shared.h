// VRPN's functions for time, and for packing messages.
#ifndef VRPN_SHARED_H
#define VRPN_SHARED_H

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>

#include <type_traits>
#include <vector>

#include "vrpn_Thread.h"
#include "vrpn_Types.h"

#define VRPN_PI (3.14159265358979323846)
#define VRPN_DEGREES_TO_RADIANS (VRPN_PI / 180.0)
#define VRPN_RADIANS_TO_DEGREES (180.0 / VRPN_PI)

#define VRPN_INCHES_TO_METERS (0.0254)
#define VRPN_METERS_TO_INCHES (1 / 0.0254)

typedef int vrpn_SOCKET;
#ifndef INVALID_SOCKET
#define INVALID_SOCKET (-1)
#endif

template <class T>
using vrpn_vector = std::vector<T>;

inline int vrpn_gettimeofday(struct timeval* now, void* = nullptr) {
  return gettimeofday(now, nullptr);
}

/// With |tv_usec| below a million and of the sign of tv_sec.
VRPN_API struct timeval vrpn_TimevalNormalize(const struct timeval& t);
VRPN_API struct timeval vrpn_TimevalSum(const struct timeval& a, const struct timeval& b);
VRPN_API struct timeval vrpn_TimevalDiff(const struct timeval& a, const struct timeval& b);
VRPN_API struct timeval vrpn_TimevalScale(const struct timeval& t, double factor);
/// Microseconds from start to end.
VRPN_API unsigned long vrpn_TimevalDuration(struct timeval end, struct timeval start);
VRPN_API double vrpn_TimevalDurationSeconds(struct timeval end, struct timeval start);
VRPN_API bool vrpn_TimevalGreater(const struct timeval& a, const struct timeval& b);
VRPN_API bool vrpn_TimevalEqual(const struct timeval& a, const struct timeval& b);
VRPN_API double vrpn_TimevalMsecs(const struct timeval& t);
VRPN_API struct timeval vrpn_MsecsTimeval(const double ms);
VRPN_API void vrpn_SleepMsecs(double ms);

/// Copies as much as fits; always terminated by a NUL.
template <size_t N>
void vrpn_strcpy(char (&to)[N], const char* from) {
  const size_t length = strnlen(from, N - 1);
  memcpy(to, from, length);
  to[length] = '\0';
}

/// Appends a scalar, big endian, and advances; -1 when fewer bytes are left.
template <class T>
int vrpn_buffer(char** insert, vrpn_int32* left, const T value) {
  static_assert(std::is_arithmetic<T>::value, "scalars only");
  if (*left < static_cast<vrpn_int32>(sizeof(T))) return -1;
  unsigned char bytes[sizeof(T)];
  memcpy(bytes, &value, sizeof(T));
  for (size_t i = 0; i < sizeof(T); ++i) {
    (*insert)[i] =
        static_cast<char>(bytes[__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? sizeof(T) - 1 - i : i]);
  }
  *insert += sizeof(T);
  *left -= static_cast<vrpn_int32>(sizeof(T));
  return 0;
}
template <class T>
int vrpn_buffer(unsigned char** insert, vrpn_int32* left, const T value) {
  char* at = reinterpret_cast<char*>(*insert);
  const int result = vrpn_buffer(&at, left, value);
  *insert = reinterpret_cast<unsigned char*>(at);
  return result;
}
/// Reads a big-endian scalar and advances.
template <class T>
int vrpn_unbuffer(const char** buffer, T* value) {
  static_assert(std::is_arithmetic<T>::value, "scalars only");
  unsigned char bytes[sizeof(T)];
  for (size_t i = 0; i < sizeof(T); ++i) {
    bytes[__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? sizeof(T) - 1 - i : i] =
        static_cast<unsigned char>((*buffer)[i]);
  }
  memcpy(value, bytes, sizeof(T));
  *buffer += sizeof(T);
  return 0;
}
template <class T, class Byte>
T vrpn_unbuffer(Byte*& buffer) {
  static_assert(sizeof(Byte) == 1, "a buffer of bytes");
  const char* at = reinterpret_cast<const char*>(buffer);
  T value;
  vrpn_unbuffer(&at, &value);
  buffer += sizeof(T);
  return value;
}

/// Between the byte orders of this machine and of messages (big endian).
inline vrpn_float64 vrpn_htond(vrpn_float64 value) {
  char bytes[sizeof value];
  char* at = bytes;
  vrpn_int32 left = sizeof value;
  vrpn_buffer(&at, &left, value);
  memcpy(&value, bytes, sizeof value);
  return value;
}
inline vrpn_float64 vrpn_ntohd(vrpn_float64 value) {
  return vrpn_htond(value);
}

/// Whether packing and unpacking work on this machine.
inline bool vrpn_test_pack_unpack() {
  char bytes[sizeof(vrpn_float64)];
  char* end = bytes;
  vrpn_int32 left = sizeof bytes;
  vrpn_buffer(&end, &left, static_cast<vrpn_float64>(-1.5));
  const char* begin = bytes;
  vrpn_float64 value = 0;
  vrpn_unbuffer(&begin, &value);
  return bytes[0] == static_cast<char>(0xBF) && value == -1.5 && vrpn_ntohd(vrpn_htond(value)) == value;
}

/// Copies at most size - 1 characters; terminated by a NUL unless size is 0.
inline char* vrpn_strncpynull(char* to, const char* from, size_t size) {
  if (size == 0) return to;
  const size_t length = strnlen(from, size - 1);
  memcpy(to, from, length);
  to[length] = '\0';
  return to;
}

VRPN_API int vrpn_buffer(char** insert, vrpn_int32* left, const struct timeval t);
VRPN_API int vrpn_unbuffer(const char** buffer, struct timeval* t);
/// Text of the given length, or (-1) up to and including its NUL.
VRPN_API int vrpn_buffer(char** insert, vrpn_int32* left, const char* text, vrpn_int32 length);
VRPN_API int vrpn_unbuffer(const char** buffer, char* text, vrpn_int32 length);

#endif
