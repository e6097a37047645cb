#include "fitting/raycast.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// Intersection of a ray with the plane of a triangle: barycentric coordinates may be outside the triangle.
struct PlaneHit {
  Vec3 barycentric;
  double distance;
  double cosine;  ///< of direction and normal, < 0 from the front
};

/// o + s d = a + u (b − a) + v (c − a), solved by Cramer's rule (Möller and Trumbore 1997).
std::optional<PlaneHit> intersect_plane(const Ray& ray, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 e1 = b - a, e2 = c - a, from_a = ray.origin - a;
  const Vec3 normal = e1.cross(e2);
  const double det = -ray.direction.dot(normal);
  if (std::abs(det) <= 1e-14 * normal.norm()) return std::nullopt;  // the ray lies in the plane to round-off
  const Vec3 q = from_a.cross(ray.direction);
  const double u = e2.dot(q) / det, v = -e1.dot(q) / det;
  return PlaneHit{Vec3(1 - u - v, u, v), from_a.dot(normal) / det, -det / normal.norm()};
}

struct DeviceRelease {
  void operator()(RTCDevice d) const { rtcReleaseDevice(d); }
};
struct SceneRelease {
  void operator()(RTCScene s) const { rtcReleaseScene(s); }
};

}  // namespace

struct RayCaster::Scene {
  MatrixX3 vertices;
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> star_begin, star;  ///< triangles around each vertex, CSR
  Vec3 shift;       ///< subtracted before rounding to float, so that precision is spent on the mesh
  double size = 0;  ///< largest distance from shift, mm
  std::unique_ptr<RTCDeviceTy, DeviceRelease> device;
  std::unique_ptr<RTCSceneTy, SceneRelease> scene;

  std::optional<PlaneHit> intersect(const Ray& ray, int triangle) const {
    const auto& t = triangles[triangle];
    return intersect_plane(ray, vertices.row(t[0]), vertices.row(t[1]), vertices.row(t[2]));
  }
};

RayCaster::RayCaster(const MatrixX3& vertices, std::vector<std::array<int, 3>> triangles)
    : scene_(std::make_unique<Scene>()) {
  Scene& s = *scene_;
  s.vertices = vertices;
  s.triangles = std::move(triangles);
  require(vertices.allFinite(), "RayCaster: a vertex is not finite");
  const int num_vertices = static_cast<int>(vertices.rows());
  s.star_begin.assign(num_vertices + 1, 0);
  for (const auto& t : s.triangles)
    for (int v : t) {
      require(v >= 0 && v < num_vertices, "RayCaster: a triangle's vertex index is out of range");
      ++s.star_begin[v + 1];
    }
  for (int v = 0; v < num_vertices; ++v) s.star_begin[v + 1] += s.star_begin[v];
  s.star.resize(s.star_begin.back());
  std::vector<int> fill(s.star_begin.begin(), s.star_begin.end() - 1);
  for (int t = 0; t < static_cast<int>(s.triangles.size()); ++t)
    for (int v : s.triangles[t]) s.star[fill[v]++] = t;

  s.shift = num_vertices == 0
                ? Vec3::Zero().eval()
                : Vec3((vertices.colwise().minCoeff() + vertices.colwise().maxCoeff()).transpose() / 2);
  s.size = num_vertices == 0 ? 0 : (vertices.rowwise() - s.shift.transpose()).rowwise().norm().maxCoeff();

  s.device.reset(rtcNewDevice("threads=1"));
  require(s.device != nullptr, "RayCaster: Embree gives no device");
  s.scene.reset(rtcNewScene(s.device.get()));
  rtcSetSceneFlags(s.scene.get(), RTC_SCENE_FLAG_ROBUST);  // watertight between neighbours
  rtcSetSceneBuildQuality(s.scene.get(), RTC_BUILD_QUALITY_HIGH);
  RTCGeometry geometry = rtcNewGeometry(s.device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), std::max(num_vertices, 1)));
  for (int v = 0; v < num_vertices; ++v)
    for (int axis = 0; axis < 3; ++axis)
      points[3 * v + axis] = static_cast<float>(vertices(v, axis) - s.shift[axis]);
  if (!s.triangles.empty()) {
    auto* corners = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), s.triangles.size()));
    for (const auto& t : s.triangles)
      for (int v : t) *corners++ = static_cast<unsigned>(v);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(s.scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(s.scene.get());
}

RayCaster::~RayCaster() = default;
RayCaster::RayCaster(RayCaster&&) noexcept = default;
RayCaster& RayCaster::operator=(RayCaster&&) noexcept = default;

std::optional<RayHit> RayCaster::cast(const Ray& ray) const {
  const Scene& s = *scene_;
  // Start close to the mesh: a far origin would eat the single-precision digits of the hit.
  const Vec3 local = ray.origin - s.shift;
  const double skipped = std::max(0.0, -local.dot(ray.direction) - s.size);
  const Vec3 start = local + skipped * ray.direction;

  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(start.x());
  query.ray.org_y = static_cast<float>(start.y());
  query.ray.org_z = static_cast<float>(start.z());
  query.ray.dir_x = static_cast<float>(ray.direction.x());
  query.ray.dir_y = static_cast<float>(ray.direction.y());
  query.ray.dir_z = static_cast<float>(ray.direction.z());
  query.ray.tnear = 0;
  query.ray.tfar = std::numeric_limits<float>::infinity();
  query.ray.mask = ~0u;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(s.scene.get(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

  // Of the triangle found and those that touch it, take the one the exact ray is deepest inside: next to an
  // edge single precision may name the neighbour.
  int triangle = static_cast<int>(query.hit.primID);
  std::optional<PlaneHit> best = s.intersect(ray, triangle);
  if (!best || best->barycentric.minCoeff() < 0) {
    for (int v : s.triangles[query.hit.primID]) {
      for (int i = s.star_begin[v]; i < s.star_begin[v + 1]; ++i) {
        const auto candidate = s.intersect(ray, s.star[i]);
        if (!candidate || !(candidate->distance > 0)) continue;
        if (!best || candidate->barycentric.minCoeff() > best->barycentric.minCoeff()) {
          best = candidate;
          triangle = s.star[i];
        }
      }
    }
  }
  if (!best || !(best->distance > 0)) return std::nullopt;

  // Outside every triangle by more than single precision explains: the exact ray passes the silhouette.
  const auto& t = s.triangles[triangle];
  const double outside = -best->barycentric.minCoeff();
  if (outside > 0) {
    const double edge = std::max((s.vertices.row(t[1]) - s.vertices.row(t[0])).norm(),
                                 (s.vertices.row(t[2]) - s.vertices.row(t[0])).norm());
    if (outside * edge > 1e-6 * s.size) return std::nullopt;
    best->barycentric = best->barycentric.cwiseMax(0.0);
    best->barycentric /= best->barycentric.sum();
  }
  RayHit hit;
  hit.triangle = triangle;
  hit.barycentric = best->barycentric;
  hit.distance = best->distance;
  hit.front_facing = best->cosine < 0;
  hit.point = hit.barycentric[0] * s.vertices.row(t[0]) + hit.barycentric[1] * s.vertices.row(t[1]) +
              hit.barycentric[2] * s.vertices.row(t[2]);
  return hit;
}

}  // namespace rhytid::fitting
