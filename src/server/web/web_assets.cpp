#include "server/web/web_assets.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

namespace hapticd::server {
namespace {

constexpr std::string_view kNoViewer = R"(<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>hapticd</title>
<h1>hapticd is running</h1>
<p>This program was built without its viewer. To include it, run in the source folder:</p>
<pre>scripts/install_packages.sh build viewer
scripts/configure_programs.sh -DHAPTICD_WEB=ON
cmake --build build/release --target hapticd</pre>
<p>The data that the viewer shows is available without it: <a href="/api/state">/api/state</a> (JSON),
<a href="/metrics">/metrics</a> (Prometheus).</p>
</html>
)";

using Buffers = std::map<std::string_view, std::shared_ptr<const net::Buffer>, std::less<>>;

// Copied once: responses share their bodies.
const Buffers& buffers() {
  static const Buffers all = [] {
    Buffers copies;
    for (const WebAsset& asset : webAssets()) {
      copies[asset.path] = std::make_shared<const net::Buffer>(asset.bytes.begin(), asset.bytes.end());
    }
    return copies;
  }();
  return all;
}

}  // namespace

std::string mediaTypeOf(std::string_view path) {
  constexpr std::array<std::pair<std::string_view, const char*>, 12> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".ico", "image/x-icon"},
      {".woff2", "font/woff2"},
      {".wasm", "application/wasm"},
      {".txt", "text/plain; charset=utf-8"},
  }};
  for (const auto& [ending, type] : kTypes) {
    if (path.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

void prepareAssets() {
  buffers();
}

net::HttpResponse assetResponse(std::string_view path) {
  const std::string_view name = path == "/" ? "index.html" : path.substr(1);
  const auto found = buffers().find(name);
  if (found == buffers().end()) {
    if (name == "index.html") return net::HttpResponse::of(200, kNoViewer, mediaTypeOf(name));
    return net::HttpResponse::of(404, "not found\n");
  }
  net::HttpResponse response;
  response.contentType = mediaTypeOf(name);
  response.body = found->second;
  return response;
}

}  // namespace hapticd::server
