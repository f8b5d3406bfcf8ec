// Lets VRPN client source compile against hapticd's client library. Names and signatures are VRPN's; the
// binary interface is not, so recompile the source.
#ifndef VRPN_CONFIGURE_H
#define VRPN_CONFIGURE_H

#include "../export.h"

#define VRPN_API HAPTICD_EXPORT
#define VRPN_CALLBACK
#define VRPN_CLIENT_ONLY
#define vrpn_DEFAULT_LISTEN_PORT_NO (3883)

#endif
