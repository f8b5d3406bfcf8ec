// Display meshes of the scenes: built by a worker on the first request, cached until the shape changes.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "base/worker.h"
#include "net/http_message.h"
#include "net/loop.h"
#include "server/web/scene_watch.h"

namespace hapticd::server {

/// Net thread.
class MeshStore {
 public:
  using Respond = std::function<void(net::HttpResponse)>;

  MeshStore(net::Loop& loop, base::Worker& worker) : loop_(loop), worker_(worker) {}
  ~MeshStore();

  /// Responds with the mesh of the object at `position` in `observed`, or with 503 when building it takes
  /// longer than 500 ms; the result is kept for the client's retry.
  void get(std::size_t scene, const ObservedScene& observed, std::size_t position, const Respond& respond);

  /// Triangles of each object's display mesh; for one that is not built yet, its upper bound.
  std::vector<std::size_t> displayTriangles(std::size_t scene, const ObservedScene& observed) const;

  /// Frees the meshes of shapes that `observed` no longer has, and cancels building them.
  void prune(std::size_t scene, const ObservedScene& observed);

 private:
  using Key = std::pair<std::size_t, std::int32_t>;  // scene, object
  struct Entry {
    std::uint64_t geometry = 0;
    std::size_t share = 0;
    std::shared_ptr<const net::Buffer> bytes;  // null while the worker builds it
    std::shared_ptr<std::atomic<bool>> cancelled = std::make_shared<std::atomic<bool>>(false);
    std::vector<Respond> waiting;
    net::Subscription timeout;
  };

  void build(const Key& key, Entry& entry, const scene::ObjectDescription& object);
  void forget(const Key& key);
  void onBuilt(const Key& key, std::uint64_t geometry, std::size_t share, net::Buffer&& bytes);

  net::Loop& loop_;
  base::Worker& worker_;
  std::map<Key, Entry> entries_;
};

}  // namespace hapticd::server
