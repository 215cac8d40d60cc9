// SPDX-License-Identifier: Apache-2.0
#include <embree3/rtcore.h>
#include <glog/logging.h>

#include <cstdint>
#include <limits>

#include "capture/render.h"

namespace sweepfit {

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

RayScene::RayScene(const TriangleMesh& mesh) : impl_(std::make_unique<Impl>()) {
  impl_->device = rtcNewDevice(nullptr);
  CHECK(impl_->device) << "Embree: " << rtcGetDeviceError(nullptr);
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  if (!mesh.triangles.empty()) {
    RTCGeometry geometry =
        rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices =
        static_cast<float*>(rtcSetNewGeometryBuffer(geometry,
                                                    RTC_BUFFER_TYPE_VERTEX,
                                                    0,
                                                    RTC_FORMAT_FLOAT3,
                                                    3 * sizeof(float),
                                                    mesh.vertices.size()));
    auto* triangles = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(geometry,
                                RTC_BUFFER_TYPE_INDEX,
                                0,
                                RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t),
                                mesh.triangles.size()));
    CHECK(vertices && triangles);
    for (const Eigen::Vector3d& vertex : mesh.vertices) {
      for (int c = 0; c < 3; ++c) *vertices++ = static_cast<float>(vertex[c]);
    }
    for (const Triangle& triangle : mesh.triangles) {
      for (const int v : triangle) *triangles++ = static_cast<std::uint32_t>(v);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(impl_->scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(impl_->scene);
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;

namespace {

template <typename Ray>
void SetRay(const Eigen::Vector3d& origin,
            const Eigen::Vector3d& direction,
            double near_distance,
            double far_distance,
            Ray* ray) {
  ray->org_x = static_cast<float>(origin.x());
  ray->org_y = static_cast<float>(origin.y());
  ray->org_z = static_cast<float>(origin.z());
  ray->dir_x = static_cast<float>(direction.x());
  ray->dir_y = static_cast<float>(direction.y());
  ray->dir_z = static_cast<float>(direction.z());
  ray->tnear = static_cast<float>(near_distance);
  ray->tfar = static_cast<float>(far_distance);
  ray->time = 0;
  ray->mask = 0xFFFFFFFFu;
  ray->id = 0;
  ray->flags = 0;
}

}  // namespace

RayScene::Hit RayScene::Intersect(const Eigen::Vector3d& origin,
                                  const Eigen::Vector3d& unit_direction,
                                  double min_distance) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  SetRay(origin,
         unit_direction,
         min_distance,
         std::numeric_limits<float>::infinity(),
         &query.ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  Hit hit;
  hit.triangle = static_cast<int>(query.hit.primID);
  hit.distance = query.ray.tfar;
  hit.b1 = query.hit.u;
  hit.b2 = query.hit.v;
  return hit;
}

bool RayScene::IsVisible(const Eigen::Vector3d& point_in_world,
                         const Eigen::Vector3d& camera_in_world,
                         double tolerance) const {
  const Eigen::Vector3d way = point_in_world - camera_in_world;
  const double distance = way.norm();
  if (distance <= tolerance) return true;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray{};
  SetRay(camera_in_world, way / distance, 0, distance - tolerance, &ray);
  rtcOccluded1(impl_->scene, &context, &ray);
  return ray.tfar >= 0;  // Embree sets it to -inf when something is hit
}

}  // namespace sweepfit
