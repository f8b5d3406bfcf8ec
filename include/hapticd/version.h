// The version of this library at compile time. Also valid in C++11 and C.
//
// While the major version is 0, a new minor version may change the interface; a patch version never does.
#ifndef HAPTICD_VERSION_H
#define HAPTICD_VERSION_H

#define HAPTICD_VERSION_MAJOR 0
#define HAPTICD_VERSION_MINOR 1
#define HAPTICD_VERSION_PATCH 0
/* One number for comparisons: #if HAPTICD_VERSION >= HAPTICD_MAKE_VERSION(0, 2, 0) */
#define HAPTICD_MAKE_VERSION(major, minor, patch) ((major)*10000 + (minor)*100 + (patch))
#define HAPTICD_VERSION \
  HAPTICD_MAKE_VERSION(HAPTICD_VERSION_MAJOR, HAPTICD_VERSION_MINOR, HAPTICD_VERSION_PATCH)
#define HAPTICD_VERSION_STRING "0.1.0"

#endif
