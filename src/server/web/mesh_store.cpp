#include "server/web/mesh_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "server/web/display_mesh.h"
#include "server/web/state_report.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

std::vector<std::size_t> sharesOf(const ObservedScene& observed) {
  std::vector<std::size_t> shares;
  std::size_t all = 0;
  std::size_t objects = 0;
  for (const scene::ObjectDescription& object : observed.description->objects) {
    shares.push_back(object.triangles ? object.triangles->size() : 0);
    all += shares.back();
    objects += shares.back() > 0 ? 1 : 0;
  }
  for (std::size_t& share : shares) share = displayShare(share, all, objects);
  return shares;
}

net::HttpResponse meshResponse(const std::shared_ptr<const net::Buffer>& bytes) {
  net::HttpResponse response;
  response.contentType = "application/octet-stream";
  response.body = bytes;
  return response;
}

net::HttpResponse busyResponse() {
  net::HttpResponse response = net::HttpResponse::of(
      503, errorJson("the mesh is being simplified for display; retry in 1 s"), "application/json");
  response.headers = {{"Retry-After", "1"}};
  return response;
}

}  // namespace

MeshStore::~MeshStore() {
  for (auto& [key, entry] : entries_) *entry.cancelled = true;
}

void MeshStore::get(std::size_t scene, const ObservedScene& observed, std::size_t position,
                    const Respond& respond) {
  const scene::ObjectDescription& object = observed.description->objects[position];
  const Key key{scene, object.id};
  const std::size_t share = sharesOf(observed)[position];
  Entry& entry = entries_[key];
  // Edits of other objects change the share a little; rebuild only when it no longer fits.
  const bool fits = entry.share <= share + share / 8 && entry.share * 2 >= share;
  if (entry.geometry != observed.geometry[position] || !fits) {
    *entry.cancelled = true;
    for (const Respond& other : entry.waiting) other(busyResponse());
    entry = Entry();
    entry.geometry = observed.geometry[position];
    entry.share = share;
    build(key, entry, object);
  }
  if (entry.bytes) return respond(meshResponse(entry.bytes));
  entry.waiting.push_back(respond);
  if (entry.waiting.size() > 1) return;  // the first one's time is that of all
  entry.timeout = loop_.after(500ms, [this, key] {
    const auto found = entries_.find(key);
    if (found == entries_.end()) return;
    for (const Respond& late : std::exchange(found->second.waiting, {})) late(busyResponse());
  });
}

// The job owns a reference to the shape: if it is the last one, the worker frees the shape, not the net
// thread.
void MeshStore::build(const Key& key, Entry& entry, const scene::ObjectDescription& object) {
  worker_.post(
      [this, key, geometry = entry.geometry, share = entry.share, cancelled = entry.cancelled,
       vertices = object.vertices, triangles = object.triangles] {
        if (*cancelled) return;
        auto bytes = std::make_shared<net::Buffer>(displayMesh(*vertices, *triangles, share, *cancelled));
        if (*cancelled) return;
        loop_.post([this, key, geometry, share, bytes] { onBuilt(key, geometry, share, std::move(*bytes)); });
      },
      [this, key, cancelled = entry.cancelled](const std::exception& error) {
        spdlog::error("web: {}", error.what());
        if (*cancelled) return;
        loop_.post([this, key, cancelled] {
          if (!*cancelled) forget(key);
        });
      });
}

// The next request builds it again.
void MeshStore::forget(const Key& key) {
  const auto entry = entries_.extract(key);
  if (!entry) return;
  for (const Respond& waiting : entry.mapped().waiting) waiting(busyResponse());
}

void MeshStore::onBuilt(const Key& key, std::uint64_t geometry, std::size_t share, net::Buffer&& bytes) {
  const auto found = entries_.find(key);
  if (found == entries_.end() || found->second.geometry != geometry || found->second.share != share) return;
  Entry& entry = found->second;
  entry.bytes = std::make_shared<const net::Buffer>(std::move(bytes));
  entry.timeout.cancel();
  for (const Respond& waiting : std::exchange(entry.waiting, {})) waiting(meshResponse(entry.bytes));
}

std::vector<std::size_t> MeshStore::displayTriangles(std::size_t scene, const ObservedScene& observed) const {
  std::vector<std::size_t> counts = sharesOf(observed);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto found = entries_.find({scene, observed.description->objects[i].id});
    if (found == entries_.end() || found->second.geometry != observed.geometry[i] || !found->second.bytes) {
      continue;
    }
    counts[i] = server::displayTriangles(*found->second.bytes);
  }
  return counts;
}

void MeshStore::prune(std::size_t scene, const ObservedScene& observed) {
  const auto& objects = observed.description->objects;
  std::erase_if(entries_, [&](auto& item) {
    if (item.first.first != scene) return false;
    const auto found = std::lower_bound(objects.begin(), objects.end(), item.first.second,
                                        [](const auto& object, std::int32_t id) { return object.id < id; });
    const bool current =
        found != objects.end() && found->id == item.first.second &&
        observed.geometry[static_cast<std::size_t>(found - objects.begin())] == item.second.geometry;
    if (current) return false;
    *item.second.cancelled = true;
    for (const Respond& waiting : item.second.waiting) waiting(busyResponse());
    return true;
  });
}

}  // namespace hapticd::server
