#include "bench/benchmark.h"

#include "bench/all.h"

namespace hapticd::bench {

const std::vector<Benchmark>& benchmarks() {
  static const std::vector<Benchmark> all{
      {"tick", "One servo step, from the hand to the force, on the path of contact, sliding and taps",
       "the bare first-hit query of Embree on the same segments", &measureTick},
      {"objects", "Many objects, one touched", "the same with one object, or with all at rest",
       &measureObjects},
      {"wakeup", "How late the loop wakes", "cyclictest with the same priority and interval", &measureWakeup},
      {"disturbance", "What clients can do to the loop and to each other",
       "the same server just before, undisturbed", &measureDisturbance},
      {"stop", "From a client's stop to the first tick that writes zero, while others upload",
       "the same server, undisturbed", &measureStop},
      {"handover", "From the state of an isolated driver to the servo's tick",
       "a bare futex between two processes", &measureHandover},
      {"burden", "The processor time of a tick among millions of triangles at the hand", "none",
       &measureBurden},
      {"remote", "The stiffest wall that settles when a client streams it, and the servo's time for contacts",
       "the same wall in the server's scene, at 1 kHz; a tick without contacts", &measureRemote},
      {"latency", "From the servo's tick to the callback of a client, isTouching at 1 kHz",
       "a raw pipeline: thread, wake, thread, TCP, blocking reader; 32 bytes at 1 kHz", &measureLatency},
      {"upload", "Meshes into the server", "raw TCP of the same bytes into a process that drops them",
       &measureUpload},
      {"fanout", "Five messages a tick at 1 kHz to many clients", "a program that only sends the same bytes",
       &measureFanOut},
      {"age", "The age of reports by datagram at 1 kHz, with other threads busy on the same machine",
       "the policy of a stock server: a thread of normal priority that sends the present state each "
       "millisecond",
       &measureAge},
      {"deform", "100k triangles, all vertices new at 60 Hz", "refitting Embree's own triangles",
       &measureDeform},
      {"memory", "A server with a mesh of a million triangles that is touched",
       "bytes of vertices, triangles and index", &measureMemory},
  };
  return all;
}

}  // namespace hapticd::bench
