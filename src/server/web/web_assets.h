// The files of the viewer, embedded into the program.
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

/// All embedded files; none in a build without the viewer.
std::span<const WebAsset> webAssets();

/// The media type for a file name, by its extension.
std::string mediaTypeOf(std::string_view path);

/// Reads all files into memory. Without it the first response does, from a disk, while clients wait.
void prepareAssets();

/// The response to a URL path; "/" is index.html. Without the viewer it is a page with build instructions;
/// 404 for an unknown path.
net::HttpResponse assetResponse(std::string_view path);

}  // namespace hapticd::server
