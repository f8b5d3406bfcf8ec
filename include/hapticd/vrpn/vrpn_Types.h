// VRPN's names for the scalars of its messages.
#ifndef VRPN_TYPES_H
#define VRPN_TYPES_H

#include "vrpn_Configure.h"

typedef char vrpn_int8;
typedef unsigned char vrpn_uint8;
typedef short vrpn_int16;
typedef unsigned short vrpn_uint16;
typedef int vrpn_int32;
typedef unsigned int vrpn_uint32;
typedef float vrpn_float32;
typedef double vrpn_float64;
typedef vrpn_int16 vrpn_bool;

const vrpn_bool vrpn_true = 1;
const vrpn_bool vrpn_false = 0;
const vrpn_bool vrpn_TRUE = 1;
const vrpn_bool vrpn_FALSE = 0;
const vrpn_bool VRPN_TRUE = 1;
const vrpn_bool VRPN_FALSE = 0;

#endif
