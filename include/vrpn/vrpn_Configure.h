// Lets VRPN client source compile against hapticd's client library. Names and signatures are VRPN's.
#ifndef VRPN_CONFIGURE_H
#define VRPN_CONFIGURE_H

#define VRPN_API
#define VRPN_CALLBACK
#define VRPN_CLIENT_ONLY
#define vrpn_DEFAULT_LISTEN_PORT_NO (3883)

#endif
