// Display meshes of the scenes: made by a worker when somebody asks, kept while the shape is the same.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "net/http_message.h"
#include "net/loop.h"
#include "server/web/scene_watch.h"
#include "server/web/worker.h"

namespace hapticd::server {

/// Net thread.
class MeshStore {
 public:
  using Answer = std::function<void(net::HttpResponse)>;

  MeshStore(net::Loop& loop, Worker& worker) : loop_(loop), worker_(worker) {}
  ~MeshStore();

  /// Answers with the mesh of the object at `position` in the view, or with 503 when that takes longer than a
  /// moment.
  void get(std::size_t scene, const SceneView& view, std::size_t position, const Answer& answer);

  /// How many triangles the page gets of each object.
  std::vector<std::size_t> displayTriangles(std::size_t scene, const SceneView& view) const;

  /// Forgets what is not in the view any more.
  void prune(std::size_t scene, const SceneView& view);

 private:
  using Key = std::pair<std::size_t, std::int32_t>;  // scene, object
  struct Entry {
    std::uint64_t geometry = 0;
    std::size_t share = 0;
    std::shared_ptr<const net::Buffer> bytes;  // null while it is being made
    std::shared_ptr<std::atomic<bool>> cancelled = std::make_shared<std::atomic<bool>>(false);
    std::vector<Answer> waiting;
    net::Subscription patience;
  };

  void make(const Key& key, Entry& entry, const scene::ObjectDescription& object);
  void onMade(const Key& key, std::uint64_t geometry, std::size_t share, net::Buffer&& bytes);

  net::Loop& loop_;
  Worker& worker_;
  std::map<Key, Entry> entries_;
};

}  // namespace hapticd::server
