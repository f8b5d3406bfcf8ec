// Not in this library.
#error "vrpn_EndpointContainer: not in hapticd's library: build this source with VRPN itself"
