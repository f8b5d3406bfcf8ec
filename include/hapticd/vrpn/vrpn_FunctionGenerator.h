// Not in this library.
#error \
    "vrpn_FunctionGenerator_Remote and vrpn_FunctionGenerator_Server are not in hapticd's library, which has no function generators: build this source with VRPN itself"
