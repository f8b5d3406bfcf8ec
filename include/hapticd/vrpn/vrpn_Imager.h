// Not in this library.
#error \
    "vrpn_Imager_Remote and vrpn_Imager_Server are not in hapticd's library, which has no images: build this source with VRPN itself"
