// One ioctl and its answer between the preloaded mock of an event file and the test that plays the kernel.
#pragma once

namespace hapticd::mock {

struct IoctlMessage {
  unsigned long request = 0;
  long number = 0;  ///< for a request whose argument is no pointer
  int error = 0;    ///< errno in the answer
  alignas(16) unsigned char data[512] = {};
};

}  // namespace hapticd::mock
