#include "scene/spatial_index.h"

#include <embree3/rtcore.h>

#include <cmath>
#include <csetjmp>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <tuple>

namespace hapticd::scene {
namespace {

// Float rounding of a coordinate is 2^-24 of its size; sixteen times that covers the box, the ray and the
// traversal.
constexpr double kRelativePad = 0x1p-20;
// Largest coordinate in the tree, of the centre of a query, and a radius that reaches everything from there.
constexpr double kReach = 4;
// A refitted tree whose boxes take less of it is built anew: its pad would be wider than they are.
constexpr double kLeastShare = 0x1p-8;
constexpr double kFarCentre = 64;
constexpr double kWholeTree = 256;
// Of a point on a segment, relative to the segment's ends.
constexpr double kDoubleRounding = 0x1p-50;
// A segment shorter than this in the tree is a point within the pad; Embree does not take such directions.
constexpr float kPoint = 0x1p-30F;

// Of a tree that is refitted in floats: none of them is so small that a processor takes it for zero.
constexpr double kSmallestScale = 0x1p-100;

// Beyond, differences and squares of coordinates would not be numbers.
constexpr double kFarthest = 1e150;

using geometry::Vec3f;

using Lanes = Eigen::Array4f;  // x, y, z and one that does not matter

Lanes lanesOf(const Vec3f& v) {
  return {v.x(), v.y(), v.z(), 0};
}

bool isUsable(const Box& box) {
  return !box.empty() && box.min.minCoeff() >= -kFarthest && box.max.maxCoeff() <= kFarthest;
}

// Half of the extent, or what is as fine as the coordinates.
double sizeOf(const Box& bounds) {
  return std::max(bounds.extents().maxCoeff() / 2, kRelativePad * bounds.centre().cwiseAbs().maxCoeff());
}

Box boundsOf(const BoxedTriangles& all) {
  Lanes low = Lanes::Constant(INFINITY);
  Lanes high = -low;
  for (std::size_t i = 0; i < 3 * all.cornerCount(); i += 3) {
    low = low.min(Eigen::Map<const Lanes>(&all.lower[i]));
    high = high.max(Eigen::Map<const Lanes>(&all.upper[i]));
  }
  return {low.head<3>().matrix().cast<double>(), high.head<3>().matrix().cast<double>()};
}

// Embree calls it an unknown error, 1, when it gets no thread, or no memory for one.
std::string reasonOf(RTCError error) {
  if (error == RTC_ERROR_OUT_OF_MEMORY) return "out of memory; raise the limit ('ulimit -v')";
  const std::string number = "Embree error " + std::to_string(error);
  if (std::getenv("HAPTICD_EMBREE") != nullptr)
    return number + "; check the HAPTICD_EMBREE environment variable";
  return number + "; raise the limits ('ulimit -v' and 'ulimit -u')";
}

RTCDevice device() {
  // One device for the process; Embree keeps its settings and error state there. HAPTICD_EMBREE passes
  // Embree's own options through, e.g. "threads=1" or "isa=sse4.2" for repeatable instruction counts.
  static RTCDevice theDevice = [] {
    const char* config = std::getenv("HAPTICD_EMBREE");
    RTCDevice created = rtcNewDevice(config);
    if (created == nullptr)
      throw std::runtime_error("Embree did not start: " + reasonOf(rtcGetDeviceError(nullptr)));
    return created;
  }();
  return theDevice;
}

[[noreturn]] void fail(const char* what) {
  throw std::runtime_error(std::string("spatial index: ") + what +
                           " failed: " + reasonOf(rtcGetDeviceError(device())));
}

struct NearQuery {
  bool (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
  std::jmp_buf end{};
};

// Embree knows no end of a point query: with a radius of 0 it still calls for every box around the point,
// which takes 30 ms among a million of them. Its frames hold nothing, so that a jump leaves them as they are.
void runNear(RTCScene scene, RTCPointQuery& point, NearQuery& query) noexcept {
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  if (setjmp(query.end) == 0) rtcPointQuery(scene, &point, &context, nullptr, &query);
}

// What lies in a convex set and within `radius` of a point that is `beyond` outside the set, is within this
// of the nearest point of the set. The pad covers rounding.
double radiusInside(double radius, double beyond, double pad) noexcept {
  const double padded = radius + pad;
  return std::min(radius, std::sqrt(std::max(0.0, (padded - beyond) * (padded + beyond))));
}

// A query with a shrinking radius: passes the caller's radius on to Embree.
struct NearestQuery {
  double (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
  double scale;
  double pad;
  double beyond;
  RTCPointQuery* point;
  static bool call(void* self, std::uint32_t id) noexcept {
    const auto* query = static_cast<const NearestQuery*>(self);
    const double wanted = query->thunk(query->visitor, id);
    const double radius = radiusInside(wanted, query->beyond, query->pad) * query->scale * (1 + kRelativePad);
    query->point->radius = std::min(query->point->radius, static_cast<float>(std::max(radius, 0.0)));
    return wanted >= 0;  // at 0 there may be ties
  }
};

// A segment can ask for the boxes around its middle instead.
struct AsNear {
  double (*thunk)(void*, std::uint32_t) noexcept;
  void* visitor;
  static bool call(void* self, std::uint32_t id) noexcept {
    const auto* adapter = static_cast<const AsNear*>(self);
    return adapter->thunk(adapter->visitor, id) >= 0;
  }
};

bool onNear(RTCPointQueryFunctionArguments* args) {
  auto* query = static_cast<NearQuery*>(args->userPtr);
  const float radius = args->query->radius;
  if (!query->thunk(query->visitor, args->primID)) std::longjmp(query->end, 1);
  return args->query->radius < radius;
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
  if (limit < 0) {  // the last one: also of the boxes around the ray's start
    rayhit->ray.tfar = -INFINITY;
    return;
  }
  const double clipped = (limit - context->begin) / context->span;
  // Rounded up, so that a tie at the same parameter is still visited and the caller can break it by id.
  const float far = std::nextafter(static_cast<float>(clipped) + 0x1p-18F, 2.0F);
  if (far < rayhit->ray.tfar) rayhit->ray.tfar = std::max(far, 0.0F);
}

}  // namespace

// Float coordinates of the tree are (p - origin) * scale and at most kReach, so that far, huge and tiny
// geometry is as exact as any other.
struct SpatialIndex::Tree {
  RTCScene scene = nullptr;
  RTCGeometry geometry = nullptr;
  Vec3 origin = Vec3::Zero();
  double scale = 1;
  // Of the commit at hand: one of them is there.
  const BoxOf* boxOf = nullptr;
  const BoxedTriangles* boxed = nullptr;
  // For boxes in floats: tree coordinates are (p - near) * times + below or above.
  Lanes near, times, below, above;

  explicit Tree(const Box& bounds) {
    origin = bounds.centre();
    const double size = sizeOf(bounds);
    // Less than 2 at first: there is room to grow by refitting.
    if (size > 0) scale = std::exp2(-std::max(std::ilogb(size), -1000));
    // What is too large or small for a float here is not refitted.
    const Vec3f rounded = origin.cast<float>();
    const Vec3 rest = (rounded.cast<double>() - origin) * scale;
    const Vec3 padding = Vec3::Constant(pad() * scale);
    near = lanesOf(rounded);
    times = lanesOf(Vec3f::Constant(static_cast<float>(scale)));
    below = lanesOf((rest - padding).cast<float>());
    above = lanesOf((rest + padding).cast<float>());
    scene = rtcNewScene(device());
    geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_USER);
    if (scene == nullptr || geometry == nullptr) fail("allocation");
  }
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  ~Tree() {
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
  }

  double pad() const noexcept { return kRelativePad * kReach / scale; }
  Vec3f inTree(const Vec3& p) const noexcept { return ((p - origin) * scale).cast<float>(); }

  // The nearest point that a query is centred on. The float error of a coordinate there, and of the distances
  // that Embree computes from it, grows with the radius of whatever reaches the tree, and so does what
  // pointQuery() adds to it. Farther away, the section of the ball with this cube is asked for.
  Vec3 nearTree(const Vec3& p) const noexcept {
    const Vec3 half = Vec3::Constant(kFarCentre / scale);
    return p.cwiseMax(origin - half).cwiseMin(origin + half);
  }

  RTCPointQuery pointQuery(const Vec3& centre, double radius) const noexcept {
    RTCPointQuery query{};
    const Vec3f at = inTree(centre);
    query.x = at.x();
    query.y = at.y();
    query.z = at.z();
    query.radius = static_cast<float>(std::min(radius * scale * (1 + kRelativePad), kWholeTree));
    return query;
  }

  Lanes lower(const Lanes& p) const noexcept { return (p - near) * times + below; }
  Lanes upper(const Lanes& p) const noexcept { return (p - near) * times + above; }

  // Without what the float path takes for granted; rounding is monotonic, so that every box within fits, too.
  bool suits(const Box& box) const noexcept {
    if (!(scale >= kSmallestScale && scale <= 1 / kSmallestScale)) return false;
    const double size = sizeOf(box);
    if (size > 0 && size * scale < kLeastShare) return false;
    const Lanes low = lower(lanesOf(box.min.cast<float>()));
    const Lanes high = upper(lanesOf(box.max.cast<float>()));
    return (low.head<3>() >= -kReach).all() && (high.head<3>() <= kReach).all();
  }

  void bounds(std::uint32_t id, RTCBounds& out) const {
    if (boxed != nullptr) return boundsOfTriangle(boxed->triangles[id], out);
    const Box box = (*boxOf)(id);
    const bool usable = isUsable(box);
    // Embree leaves out boxes that are inverted.
    const Vec3f low = usable ? inTree(box.min - Vec3::Constant(pad())) : Vec3f::Constant(INFINITY);
    const Vec3f high = usable ? inTree(box.max + Vec3::Constant(pad())) : Vec3f::Constant(-INFINITY);
    out = {low.x(), low.y(), low.z(), 0, high.x(), high.y(), high.z(), 0};
  }

  // Asked for each triangle of a mesh, again and again.
  void boundsOfTriangle(const Triangle& t, RTCBounds& out) const noexcept {
    if (std::max({t[0], t[1], t[2]}) >= boxed->cornerCount()) {
      out = {INFINITY, INFINITY, INFINITY, 0, -INFINITY, -INFINITY, -INFINITY, 0};
      return;
    }
    const auto corner = [](std::span<const float> of, std::uint32_t i) noexcept -> Lanes {
      return Eigen::Map<const Lanes>(of.data() + std::size_t{3} * i);
    };
    const auto& [low, high] = std::tie(boxed->lower, boxed->upper);
    Eigen::Map<Lanes>(&out.lower_x) = lower(corner(low, t[0]).min(corner(low, t[1])).min(corner(low, t[2])));
    Eigen::Map<Lanes>(&out.upper_x) =
        upper(corner(high, t[0]).max(corner(high, t[1])).max(corner(high, t[2])));
  }

  void commit() {
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene);
    boxOf = nullptr;
    boxed = nullptr;
    if (const RTCError error = rtcGetDeviceError(device()); error != RTC_ERROR_NONE)
      throw std::runtime_error("spatial index: " + reasonOf(error));
  }
};

SpatialIndex::SpatialIndex() noexcept = default;
SpatialIndex::~SpatialIndex() = default;
SpatialIndex::SpatialIndex(SpatialIndex&&) noexcept = default;
SpatialIndex& SpatialIndex::operator=(SpatialIndex&&) noexcept = default;

SpatialIndex SpatialIndex::build(std::uint32_t count, const BoxOf& boxOf) {
  SpatialIndex index;
  index.count_ = count;
  for (std::uint32_t id = 0; id < count; ++id) {
    const Box box = boxOf(id);
    if (isUsable(box)) index.bounds_.extend(box);
  }
  if (index.bounds_.empty()) return index;

  index.tree_ = std::make_unique<Tree>(index.bounds_);
  Tree& tree = *index.tree_;
  index.pad_ = tree.pad();
  // A dynamic scene keeps one tree for each geometry, and refits it if that was its quality from the start.
  // This is also the fastest to build and to query here.
  rtcSetSceneFlags(tree.scene, RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
  rtcSetSceneBuildQuality(tree.scene, RTC_BUILD_QUALITY_LOW);
  rtcSetGeometryBuildQuality(tree.geometry, RTC_BUILD_QUALITY_REFIT);
  rtcSetGeometryUserPrimitiveCount(tree.geometry, count);
  rtcSetGeometryUserData(tree.geometry, &tree);
  const auto bounds = [](const RTCBoundsFunctionArguments* args) {
    static_cast<Tree*>(args->geometryUserPtr)->bounds(args->primID, *args->bounds_o);
  };
  rtcSetGeometryBoundsFunction(tree.geometry, bounds, nullptr);
  rtcSetGeometryIntersectFunction(tree.geometry, &onSegment);
  rtcSetGeometryPointQueryFunction(tree.geometry, &onNear);
  rtcAttachGeometry(tree.scene, tree.geometry);
  tree.boxOf = &boxOf;
  tree.commit();
  return index;
}

Box BoxedTriangles::boxOf(std::uint32_t triangle) const noexcept {
  Box box;
  for (const std::uint32_t corner : triangles[triangle]) {
    if (corner >= cornerCount()) return {};
    const std::size_t at = std::size_t{3} * corner;
    box.extend(Box{Eigen::Map<const Vec3f>(&lower[at]).cast<double>(),
                   Eigen::Map<const Vec3f>(&upper[at]).cast<double>()});
  }
  return box;
}

SpatialIndex SpatialIndex::build(const BoxedTriangles& all) {
  SpatialIndex index = build(static_cast<std::uint32_t>(all.triangles.size()),
                             [&](std::uint32_t id) { return all.boxOf(id); });
  if (index.tree_) index.bounds_ = boundsOf(all);
  return index;
}

void SpatialIndex::refit(const BoxedTriangles& all) {
  const Box bounds = boundsOf(all);
  if (!tree_ || !tree_->suits(bounds)) {
    *this = build(all);
    return;
  }
  tree_->boxed = &all;
  tree_->commit();
  // To the bit what build() would give: the renderer takes lengths from them.
  bounds_ = bounds;
  ++refits_;
}

// Whether any of the bounds is within `radius` of the centre.
bool SpatialIndex::isWithin(double radius, const Vec3& centre) const noexcept {
  return (centre.cwiseMax(bounds_.min).cwiseMin(bounds_.max) - centre).norm() <= radius + pad_;
}

void SpatialIndex::visitNearestImpl(const Vec3& centre, double radius, SegmentThunk thunk,
                                    void* visitor) const noexcept {
  if (!tree_ || !isWithin(radius, centre)) return;
  const Vec3 inside = tree_->nearTree(centre);
  const double beyond = (inside - centre).norm();
  RTCPointQuery point = tree_->pointQuery(inside, radiusInside(radius, beyond, pad_));
  NearestQuery query{thunk, visitor, tree_->scale, pad_, beyond, &point};
  NearQuery adapter{&NearestQuery::call, &query};
  runNear(tree_->scene, point, adapter);
}

void SpatialIndex::visitNearImpl(const Vec3& centre, double radius, NearThunk thunk,
                                 void* visitor) const noexcept {
  if (!tree_ || !isWithin(radius, centre)) return;
  const Vec3 inside = tree_->nearTree(centre);
  const double beyond = (inside - centre).norm();
  NearQuery query{thunk, visitor};
  RTCPointQuery point = tree_->pointQuery(inside, radiusInside(radius, beyond, pad_));
  runNear(tree_->scene, point, query);
}

void SpatialIndex::visitSegmentImpl(const Vec3& from, const Vec3& to, SegmentThunk thunk,
                                    void* visitor) const noexcept {
  if (!tree_) return;
  // Clipped to the bounds in double, so that the ray starts where a float is as fine as the pad.
  const double rounding = kDoubleRounding * std::max(from.cwiseAbs().maxCoeff(), to.cwiseAbs().maxCoeff());
  const double margin = pad_ + rounding;
  double begin = 0;
  double end = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double origin = from[axis];
    const double direction = to[axis] - origin;
    const double lower = bounds_.min[axis] - margin;
    const double upper = bounds_.max[axis] + margin;
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
  if (!start.allFinite() || !reach.allFinite()) return;
  const Vec3f origin = tree_->inTree(start);
  const Vec3f direction = (reach * tree_->scale).cast<float>();
  // So short that it is a point, or so long that a double misses the whole tree by more than the pad.
  if (end == begin || direction.cwiseAbs().maxCoeff() < kPoint || rounding > 0.25 * pad_) {
    AsNear adapter{thunk, visitor};
    visitNearImpl(start + 0.5 * reach, 0.5 * reach.norm() + margin, &AsNear::call, &adapter);
    return;
  }
  SegmentContext context{};
  rtcInitIntersectContext(&context.embree);
  context.thunk = thunk;
  context.visitor = visitor;
  context.begin = begin;
  context.span = end - begin;
  RTCRayHit ray{};
  ray.ray.org_x = origin.x();
  ray.ray.org_y = origin.y();
  ray.ray.org_z = origin.z();
  ray.ray.dir_x = direction.x();
  ray.ray.dir_y = direction.y();
  ray.ray.dir_z = direction.z();
  ray.ray.tnear = 0;
  ray.ray.tfar = 1 + 0x1p-18F;
  ray.ray.mask = 0xFFFFFFFFU;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(tree_->scene, &context.embree, &ray);
}

}  // namespace hapticd::scene
