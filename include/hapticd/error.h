// Exceptions of the client. Wrong arguments are std::invalid_argument instead.
#pragma once

#include <stdexcept>

#include "hapticd/export.h"

namespace hapticd {

/// A failure between client and server. what() names both, the cause and, where there is one, the remedy.
class HAPTICD_EXPORT Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
/// There is no connection, or the server has no such device.
class HAPTICD_EXPORT ConnectError : public Error {
 public:
  using Error::Error;
};
/// The connection ended while data was being sent, or the server accepted no data for
/// ClientOptions::sendTimeout.
class HAPTICD_EXPORT ConnectionLost : public Error {
 public:
  using Error::Error;
};
/// The server or its device does not support the call: another make, an older version, or another kind of
/// device.
class HAPTICD_EXPORT Unsupported : public Error {
 public:
  using Error::Error;
};
/// The server refused a command; what() quotes its text. Only with ClientOptions::throwOnError.
class HAPTICD_EXPORT ServerError : public Error {
 public:
  using Error::Error;
};

}  // namespace hapticd
