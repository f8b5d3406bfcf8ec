// Uploads of meshes: thousands of vertices per message where the server supports it, else one by one.
#include <algorithm>
#include <stdexcept>

#include "client/client_impl.h"

namespace hapticd {
namespace {

using Vertices = std::span<const std::array<float, 3>>;
using Triangles = std::span<const std::array<std::uint32_t, 3>>;

// Vertices of a block share a time stamp: reading the clock costs more than encoding a vertex.
constexpr std::size_t kBlock = 1024;
constexpr std::uint64_t kVertexFrameBytes =
    wire::kHeaderBytes + wire::padded(wire::kPayloadSize<wire::SetVertex>);
constexpr std::uint64_t kClearFrameBytes =
    wire::kHeaderBytes + wire::padded(wire::kPayloadSize<wire::ClearTrimesh>);

/// Bytes of this many vertices or triangles, in messages of at most Run::kMost.
template <class Run>
std::uint64_t runBytes(std::size_t count) {
  const std::size_t runs = (count + Run::kMost - 1) / Run::kMost;
  return runs * (wire::kHeaderBytes + wire::padded(wire::payloadSize(Run{}))) + count * 12;
}

/// Counts the bytes of one upload that the system has accepted, and reports progress.
class Upload {
 public:
  Upload(client::Link& link, std::uint64_t bytes, const Client::Callback<UploadProgress>& progress)
      : link_(link),
        progress_(progress),
        start_((link.flush(), link.streamBytes())),
        connection_(link.connectionNumber()) {
    state_.bytesTotal = bytes;
    link_.onDrainStep = [this] { report(); };
  }
  ~Upload() { link_.onDrainStep = nullptr; }
  Upload(const Upload&) = delete;
  Upload& operator=(const Upload&) = delete;

  void check() const {
    if (!link_.connected() || link_.connectionNumber() != connection_) {
      throw ConnectionLost("connection to " + link_.server().text() + " lost after " +
                           std::to_string(state_.bytesSent) + " of " + std::to_string(state_.bytesTotal) +
                           " bytes of a mesh: " + link_.whyNotConnected());
    }
  }

  void finish() {
    link_.drainTo(0);
    reported_ = reported_ && state_.bytesSent == state_.bytesTotal;
    update(state_.bytesTotal);
  }

 private:
  void report() {
    const std::uint64_t taken = link_.streamBytesTaken();
    update(taken > start_ ? std::min(taken - start_, state_.bytesTotal) : 0);
  }
  void update(std::uint64_t sent) {
    if (sent == state_.bytesSent && reported_) return;
    state_.bytesSent = sent;
    reported_ = true;
    if (progress_) progress_(state_);
  }

  client::Link& link_;
  const Client::Callback<UploadProgress>& progress_;
  std::uint64_t start_;
  std::uint64_t connection_;
  UploadProgress state_;
  bool reported_ = false;
};

template <class CornerAt>
void sendCorners(client::Link& link, wire::LocalSender sender, int object, std::size_t count,
                 const std::function<void()>& check, CornerAt&& cornerAt) {
  for (std::size_t block = 0; block < count; block += kBlock) {
    check();
    const wire::Time now = client::wireNow();
    for (std::size_t i = block; i < std::min(count, block + kBlock); ++i) {
      link.send(now, sender, wire::SetVertex{object, static_cast<std::int32_t>(i), cornerAt(i)});
    }
  }
}

void checkTriangles(Vertices vertices, Triangles triangles) {
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const std::uint32_t vertex : triangles[t]) {
      if (vertex >= vertices.size()) {
        throw std::invalid_argument("triangle " + std::to_string(t) + " names vertex " +
                                    std::to_string(vertex) + ", the mesh has " +
                                    std::to_string(vertices.size()));
      }
    }
  }
}

}  // namespace

void Client::Impl::sendRuns(int object, std::size_t first, Vertices vertices, Triangles triangles,
                            const std::function<void()>& check) {
  wire::MeshVertices run{object, 0, {}};
  for (std::size_t i = 0; i < vertices.size(); i += run.kMost) {
    if (check) check();
    run.first = static_cast<std::int32_t>(first + i);
    run.positions.values.clear();
    for (const auto& v : vertices.subspan(i, std::min(run.kMost, vertices.size() - i))) {
      run.positions.values.insert(run.positions.values.end(), v.begin(), v.end());
    }
    send(run);
  }
  wire::MeshTriangles faces{object, 0, {}};
  for (std::size_t i = 0; i < triangles.size(); i += faces.kMost) {
    if (check) check();
    faces.first = static_cast<std::int32_t>(i);
    faces.vertices.values.clear();
    for (const auto& t : triangles.subspan(i, std::min(faces.kMost, triangles.size() - i))) {
      for (const std::uint32_t v : t) faces.vertices.values.push_back(static_cast<std::int32_t>(v));
    }
    send(faces);
  }
}

// In a batch if it fits, so that no tick renders half a mesh.
void Client::Impl::uploadRuns(int object, Vertices vertices, Triangles triangles,
                              const Callback<UploadProgress>& progress) {
  if (link.holding()) {
    send(wire::ClearTrimesh{object});
    return sendRuns(object, 0, vertices, triangles, [&] { link.runOnce(); });
  }
  const std::uint64_t bytes = kClearFrameBytes + runBytes<wire::MeshVertices>(vertices.size()) +
                              runBytes<wire::MeshTriangles>(triangles.size());
  Upload upload(link, bytes, progress);
  if (has(wire::kFeatureBatch) && bytes <= client::Link::kMaxBatchBytes) {
    client::HeldBatch batch(link);
    send(wire::ClearTrimesh{object});
    sendRuns(object, 0, vertices, triangles, [&] { link.runOnce(); });  // heartbeats
    upload.check();
    batch.commit(sender);
  } else {
    send(wire::ClearTrimesh{object});
    sendRuns(object, 0, vertices, triangles, [&] { upload.check(); });
  }
  upload.check();
  upload.finish();
}

template <class CornerAt>
void Client::Impl::uploadTriples(int object, std::size_t count, const Callback<UploadProgress>& progress,
                                 CornerAt&& cornerAt) {
  send(wire::ClearTrimesh{object});
  if (link.holding())
    return sendCorners(
        link, sender, object, count, [] {}, cornerAt);
  Upload upload(link, count * kVertexFrameBytes, progress);
  sendCorners(
      link, sender, object, count, [&] { upload.check(); }, cornerAt);
  upload.check();
  upload.finish();
}

void Client::uploadMesh(int object, const MeshView& mesh, const Callback<UploadProgress>& progress) {
  checkTriangles(mesh.vertices, mesh.triangles);
  if (!connected()) waitConnected(impl_->options.connectTimeout);
  impl_->waitAnswered();
  if (impl_->has(wire::kFeatureBulkMesh)) {
    // Servers take vertices without triangles for a list of corners.
    const Vertices vertices = mesh.triangles.empty() ? Vertices{} : mesh.vertices;
    impl_->uploadRuns(object, vertices, mesh.triangles, progress);
  } else {
    impl_->uploadTriples(object, mesh.triangles.size() * 3, progress,
                         [&](std::size_t i) { return mesh.vertices[mesh.triangles[i / 3][i % 3]]; });
  }
}

void Client::uploadCorners(int object, std::span<const std::array<float, 3>> corners,
                           const Callback<UploadProgress>& progress) {
  if (corners.size() % 3 != 0)
    throw std::invalid_argument("uploadCorners: " + std::to_string(corners.size()) +
                                " corners, give three for each triangle");
  if (!connected()) waitConnected(impl_->options.connectTimeout);
  impl_->waitAnswered();
  if (impl_->has(wire::kFeatureBulkMesh)) {
    impl_->uploadRuns(object, corners, {}, progress);
  } else {
    impl_->uploadTriples(object, corners.size(), progress, [&](std::size_t i) { return corners[i]; });
  }
}

void Client::setVertices(int object, int first, std::span<const std::array<float, 3>> positions) {
  if (impl_->has(wire::kFeatureBulkMesh)) {
    return impl_->sendRuns(object, static_cast<std::size_t>(first), positions, {}, {});
  }
  const wire::Time now = client::wireNow();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    impl_->link.send(now, impl_->sender, wire::SetVertex{object, first + static_cast<int>(i), positions[i]});
  }
}

}  // namespace hapticd
