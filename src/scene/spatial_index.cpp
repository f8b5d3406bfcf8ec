#include "scene/spatial_index.h"

#include <embree3/rtcore.h>

#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

namespace hapticd::scene {
namespace {

// Float rounding of a coordinate is 2^-24 of its size; sixteen times that covers the box, the ray and the
// traversal.
constexpr double kRelativePad = 0x1p-20;

RTCDevice device() {
  // One device for the process; Embree keeps its settings and error state there. HAPTICD_EMBREE passes
  // Embree's own options through, e.g. "threads=1" or "isa=sse4.2" for repeatable instruction counts.
  static RTCDevice theDevice = [] {
    const char* config = std::getenv("HAPTICD_EMBREE");
    RTCDevice created = rtcNewDevice(config);
    if (created == nullptr) {
      throw std::runtime_error("Embree did not start (error " + std::to_string(rtcGetDeviceError(nullptr)) +
                               "); check the HAPTICD_EMBREE environment variable");
    }
    return created;
  }();
  return theDevice;
}

[[noreturn]] void fail(const char* what) {
  throw std::runtime_error(std::string("spatial index: ") + what + " failed, Embree error " +
                           std::to_string(rtcGetDeviceError(device())));
}

struct NearQuery {
  void (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
};

// A segment without length asks for the boxes around its point.
struct AsNear {
  double (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
  static void call(void* self, std::uint32_t id) noexcept {
    const auto* adapter = static_cast<const AsNear*>(self);
    adapter->thunk(adapter->visitor, id);
  }
};

bool onNear(RTCPointQueryFunctionArguments* args) {
  const auto* query = static_cast<const NearQuery*>(args->userPtr);
  query->thunk(query->visitor, args->primID);
  return false;
}

// Embree hands the context back to the leaf callback: the extra members follow its own.
struct SegmentContext {
  RTCIntersectContext embree;
  double (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
  double begin;  // parameter of the clipped ray's start on the caller's segment
  double span;   // and its length
};

void onSegment(const RTCIntersectFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  auto* context = reinterpret_cast<SegmentContext*>(args->context);
  auto* rayhit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const double limit = context->thunk(context->visitor, args->primID);
  const double clipped = (limit - context->begin) / context->span;
  // Rounded up, so that a tie at the same parameter is still visited and the caller can break it by id.
  const float far = std::nextafter(static_cast<float>(clipped) + 0x1p-18F, 2.0F);
  if (far < rayhit->ray.tfar) rayhit->ray.tfar = std::max(far, 0.0F);
}

}  // namespace

struct SpatialIndex::Tree {
  RTCScene scene = nullptr;
  RTCGeometry geometry = nullptr;
  const BoxOf* boxOf = nullptr;  // only during a build
  double pad = 0;

  ~Tree() {
    if (geometry != nullptr) rtcReleaseGeometry(geometry);
    if (scene != nullptr) rtcReleaseScene(scene);
  }

  static void bounds(const RTCBoundsFunctionArguments* args) {
    const auto* tree = static_cast<const Tree*>(args->geometryUserPtr);
    const Box box = (*tree->boxOf)(args->primID);
    RTCBounds& out = *args->bounds_o;
    if (box.empty()) {
      // Embree leaves out primitives with inverted or infinite bounds.
      out.lower_x = out.lower_y = out.lower_z = INFINITY;
      out.upper_x = out.upper_y = out.upper_z = -INFINITY;
      return;
    }
    const Vec3 lower = box.min.array() - tree->pad;
    const Vec3 upper = box.max.array() + tree->pad;
    out.lower_x = static_cast<float>(lower.x());
    out.lower_y = static_cast<float>(lower.y());
    out.lower_z = static_cast<float>(lower.z());
    out.upper_x = static_cast<float>(upper.x());
    out.upper_y = static_cast<float>(upper.y());
    out.upper_z = static_cast<float>(upper.z());
  }
};

SpatialIndex::SpatialIndex() noexcept = default;
SpatialIndex::~SpatialIndex() = default;
SpatialIndex::SpatialIndex(SpatialIndex&&) noexcept = default;
SpatialIndex& SpatialIndex::operator=(SpatialIndex&&) noexcept = default;

namespace {
double padFor(const Box& bounds) {
  if (bounds.empty()) return 0;
  return kRelativePad * std::max(bounds.min.cwiseAbs().maxCoeff(), bounds.max.cwiseAbs().maxCoeff());
}
}  // namespace

SpatialIndex SpatialIndex::build(std::uint32_t count, const BoxOf& boxOf) {
  SpatialIndex index;
  index.count_ = count;
  for (std::uint32_t id = 0; id < count; ++id) {
    const Box box = boxOf(id);
    if (!box.empty()) index.bounds_.extend(box);
  }
  if (index.bounds_.empty()) return index;
  index.pad_ = padFor(index.bounds_);

  index.tree_ = std::make_unique<Tree>();
  Tree& tree = *index.tree_;
  tree.boxOf = &boxOf;
  tree.pad = index.pad_;
  tree.scene = rtcNewScene(device());
  tree.geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
  if (tree.scene == nullptr || tree.geometry == nullptr) fail("allocation");
  rtcSetSceneFlags(tree.scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetGeometryUserPrimitiveCount(tree.geometry, count);
  rtcSetGeometryUserData(tree.geometry, &tree);
  rtcSetGeometryBoundsFunction(tree.geometry, &Tree::bounds, nullptr);
  rtcSetGeometryIntersectFunction(tree.geometry, &onSegment);
  rtcSetGeometryPointQueryFunction(tree.geometry, &onNear);
  rtcCommitGeometry(tree.geometry);
  rtcAttachGeometry(tree.scene, tree.geometry);
  rtcCommitScene(tree.scene);
  tree.boxOf = nullptr;
  if (const RTCError error = rtcGetDeviceError(device()); error != RTC_ERROR_NONE) {
    throw std::runtime_error("spatial index over " + std::to_string(count) + " boxes: Embree error " +
                             std::to_string(error));
  }
  return index;
}

void SpatialIndex::refit(const BoxOf& boxOf) {
  *this = build(count_, boxOf);
}

void SpatialIndex::visitNearImpl(const Vec3& centre, double radius, NearThunk thunk,
                                 void* visitor) const noexcept {
  if (!tree_) return;
  // Outside the bounds the float error of the centre could exceed the pad, so the sphere is centred on its
  // clamped point: every box within reach of the centre is within the same reach of the clamped one.
  const Vec3 inside = centre.cwiseMax(bounds_.min).cwiseMin(bounds_.max);
  if (!((inside - centre).norm() <= radius + pad_)) return;
  NearQuery query{thunk, visitor};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  RTCPointQuery point{};
  point.x = static_cast<float>(inside.x());
  point.y = static_cast<float>(inside.y());
  point.z = static_cast<float>(inside.z());
  point.radius = std::nextafter(static_cast<float>(radius), INFINITY);
  rtcPointQuery(tree_->scene, &point, &context, nullptr, &query);
}

void SpatialIndex::visitSegmentImpl(const Vec3& from, const Vec3& to, SegmentThunk thunk,
                                    void* visitor) const noexcept {
  if (!tree_) return;
  // Clipped to the bounds in double, so that the ray starts where a float is as fine as the pad.
  double begin = 0;
  double end = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = from[axis];
    const double direction = to[axis] - origin;
    const double lower = bounds_.min[axis] - pad_;
    const double upper = bounds_.max[axis] + pad_;
    if (direction == 0) {
      if (!(origin >= lower && origin <= upper)) return;
      continue;
    }
    const double t0 = (lower - origin) / direction;
    const double t1 = (upper - origin) / direction;
    begin = std::max(begin, std::min(t0, t1));
    end = std::min(end, std::max(t0, t1));
  }
  if (!(begin <= end)) return;
  const Vec3 start = from + begin * (to - from);
  const Vec3 reach = (end - begin) * (to - from);
  if (reach.squaredNorm() == 0 || end == begin) {
    AsNear adapter{thunk, visitor};
    visitNearImpl(start, pad_, &AsNear::call, &adapter);
    return;
  }
  SegmentContext context{};
  rtcInitIntersectContext(&context.embree);
  context.thunk = thunk;
  context.visitor = visitor;
  context.begin = begin;
  context.span = end - begin;
  RTCRayHit ray{};
  ray.ray.org_x = static_cast<float>(start.x());
  ray.ray.org_y = static_cast<float>(start.y());
  ray.ray.org_z = static_cast<float>(start.z());
  ray.ray.dir_x = static_cast<float>(reach.x());
  ray.ray.dir_y = static_cast<float>(reach.y());
  ray.ray.dir_z = static_cast<float>(reach.z());
  ray.ray.tnear = 0;
  ray.ray.tfar = 1 + 0x1p-18F;
  ray.ray.mask = 0xFFFFFFFFU;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(tree_->scene, &context.embree, &ray);
}

}  // namespace hapticd::scene
