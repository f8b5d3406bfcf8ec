// The page: files that are part of the program.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "net/http_message.h"

namespace hapticd::server {

/// One file of the bundle.
struct WebAsset {
  std::string_view path;  ///< below the bundle's folder: "viewer.js"
  std::span<const std::byte> bytes;
};

/// What the build has embedded; empty when it was built without the viewer.
std::span<const WebAsset> webAssets();

/// The media type that goes with a file name.
std::string mediaTypeOf(std::string_view path);

/// The file at a path of a URL, "/" being index.html, or a page that says how to build the viewer. 404 when
/// there is none.
net::HttpResponse assetResponse(std::string_view path);

}  // namespace hapticd::server
