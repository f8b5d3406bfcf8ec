// Marks what the shared libraries export; everything else in them is hidden. Also valid in C++11 and C.
#ifndef HAPTICD_EXPORT_H
#define HAPTICD_EXPORT_H

#define HAPTICD_EXPORT __attribute__((visibility("default")))
#define HAPTICD_HIDDEN __attribute__((visibility("hidden")))

#endif
