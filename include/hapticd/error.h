// What a client throws.
#pragma once

#include <stdexcept>

namespace hapticd {

/// Anything that goes wrong between client and server; what() names both, and the remedy where there is one.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
/// There is no connection, or not the device asked for.
class ConnectError : public Error {
 public:
  using Error::Error;
};
/// The connection ended while something was being sent, or the server took nothing for too long.
class ConnectionLost : public Error {
 public:
  using Error::Error;
};
/// The server is too old, of another make, or its device is of another kind: it cannot do what was asked.
class Unsupported : public Error {
 public:
  using Error::Error;
};
/// The server refused a command, in its own words.
class ServerError : public Error {
 public:
  using Error::Error;
};

}  // namespace hapticd
