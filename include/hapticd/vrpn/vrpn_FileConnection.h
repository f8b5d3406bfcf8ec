// VRPN's switches for reading log files, so that programs that set them compile. This library reads none.
#ifndef VRPN_FILE_CONNECTION_H
#define VRPN_FILE_CONNECTION_H

#include "vrpn_Connection.h"

extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_PRELOAD;
extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_ACCUMULATE;
extern VRPN_API bool vrpn_FILE_CONNECTIONS_SHOULD_SKIP_TO_USER_MESSAGES;

#endif
