// How VRPN reads log files. This library reads none; programs that set how they want it compile all the same.
#ifndef VRPN_FILE_CONNECTION_H
#define VRPN_FILE_CONNECTION_H

#include "vrpn_Connection.h"

extern bool vrpn_FILE_CONNECTIONS_SHOULD_PRELOAD;
extern bool vrpn_FILE_CONNECTIONS_SHOULD_ACCUMULATE;
extern bool vrpn_FILE_CONNECTIONS_SHOULD_SKIP_TO_USER_MESSAGES;

#endif
