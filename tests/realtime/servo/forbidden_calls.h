// An interposer: while a thread is inside a tick, whatever can block or take an unbounded time is noted.
//
// It stands in front of malloc and its kin (and so of new, delete and every throw), mutexes, condition
// variables, read-write locks and futexes of the whole program, the C library's callers and Embree included.
#pragma once

namespace hapticd::realtime::law {

/// The calling thread enters or leaves a section in which nothing is allowed.
void enter() noexcept;
void leave() noexcept;

/// Calls noted in all threads so far.
int violations() noexcept;
/// Name of the first one; empty when there was none.
const char* firstViolation() noexcept;
/// Prints the stack of the first one on standard error.
void printFirstViolation() noexcept;
/// Forgets what was noted.
void forget() noexcept;

}  // namespace hapticd::realtime::law
