#include "server/web/mesh_store.h"

#include <algorithm>
#include <chrono>

#include "server/web/display_mesh.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

std::vector<std::size_t> sharesOf(const SceneView& view) {
  std::vector<std::size_t> shares;
  std::size_t all = 0;
  std::size_t objects = 0;
  for (const scene::ObjectDescription& object : view.description->objects) {
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
  net::HttpResponse response =
      net::HttpResponse::of(503, R"({"error": "the mesh is being made; ask again"})", "application/json");
  response.headers = {{"Retry-After", "1"}};
  return response;
}

}  // namespace

MeshStore::~MeshStore() {
  for (auto& [key, entry] : entries_) *entry.cancelled = true;
}

void MeshStore::get(std::size_t scene, const SceneView& view, std::size_t position, const Answer& answer) {
  const scene::ObjectDescription& object = view.description->objects[position];
  const Key key{scene, object.id};
  const std::size_t share = sharesOf(view)[position];
  Entry& entry = entries_[key];
  // Other objects change the share a little all the time; that is no reason to make it anew.
  const bool fits = entry.share <= share + share / 8 && entry.share * 2 >= share;
  if (entry.geometry != view.geometry[position] || !fits) {
    *entry.cancelled = true;
    for (const Answer& other : entry.waiting) other(busyResponse());
    entry = Entry();
    entry.geometry = view.geometry[position];
    entry.share = share;
    make(key, entry, object);
  }
  if (entry.bytes) return answer(meshResponse(entry.bytes));
  entry.waiting.push_back(answer);
  entry.patience = loop_.after(500ms, [this, key] {
    const auto found = entries_.find(key);
    if (found == entries_.end()) return;
    for (const Answer& late : std::exchange(found->second.waiting, {})) late(busyResponse());
  });
}

// The job holds the shape and frees it in the worker, should it be the last to hold it.
void MeshStore::make(const Key& key, Entry& entry, const scene::ObjectDescription& object) {
  worker_.post([this, key, geometry = entry.geometry, share = entry.share, cancelled = entry.cancelled,
                vertices = object.vertices, triangles = object.triangles] {
    if (*cancelled) return;
    auto bytes = std::make_shared<net::Buffer>(displayMesh(*vertices, *triangles, share, *cancelled));
    if (*cancelled) return;
    loop_.post([this, key, geometry, share, bytes] { onMade(key, geometry, share, std::move(*bytes)); });
  });
}

void MeshStore::onMade(const Key& key, std::uint64_t geometry, std::size_t share, net::Buffer&& bytes) {
  const auto found = entries_.find(key);
  if (found == entries_.end() || found->second.geometry != geometry || found->second.share != share) return;
  Entry& entry = found->second;
  entry.bytes = std::make_shared<const net::Buffer>(std::move(bytes));
  entry.patience.cancel();
  for (const Answer& reply : std::exchange(entry.waiting, {})) reply(meshResponse(entry.bytes));
}

std::vector<std::size_t> MeshStore::displayTriangles(std::size_t scene, const SceneView& view) const {
  std::vector<std::size_t> counts = sharesOf(view);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const auto found = entries_.find({scene, view.description->objects[i].id});
    if (found == entries_.end() || found->second.geometry != view.geometry[i] || !found->second.bytes) {
      continue;
    }
    counts[i] = server::displayTriangles(*found->second.bytes);
  }
  return counts;
}

void MeshStore::prune(std::size_t scene, const SceneView& view) {
  const auto& objects = view.description->objects;
  std::erase_if(entries_, [&](auto& item) {
    if (item.first.first != scene) return false;
    const auto found = std::lower_bound(objects.begin(), objects.end(), item.first.second,
                                        [](const auto& object, std::int32_t id) { return object.id < id; });
    const bool there =
        found != objects.end() && found->id == item.first.second &&
        view.geometry[static_cast<std::size_t>(found - objects.begin())] == item.second.geometry;
    if (there) return false;
    *item.second.cancelled = true;
    for (const Answer& reply : item.second.waiting) reply(busyResponse());
    return true;
  });
}

}  // namespace hapticd::server
