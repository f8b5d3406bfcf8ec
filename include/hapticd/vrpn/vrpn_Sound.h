// Not in this library.
#error \
    "vrpn_Sound_Client and vrpn_Sound_Server are not in hapticd's library, which has no sound: build this source with VRPN itself"
