#include "dem/geometry/wall.h"

#include <utility>

namespace calib::dem {

void Wall::Move(double dt) {
  if (!Moves()) {
    return;
  }
  const Vec3 step = dt * velocity;
  if (IsPlane()) {
    point = point + step;
    centre = centre + step;
    return;
  }
  // Cayley: v' = v + 2/(1 + h.h) (h x v + h x (h x v)), h = w dt/2.
  const Vec3 h = (0.5 * dt) * angular_velocity;
  const double factor = 2.0 / (1.0 + Dot(h, h));
  for (Vec3& v : mesh.vertex) {
    const Vec3 arm = v - centre;
    const Vec3 turned = Cross(h, arm);
    v = centre + step + arm + factor * (turned + Cross(h, turned));
  }
  centre = centre + step;
}

Wall MakePlane(std::string name, const Vec3& point, const Vec3& normal) {
  Wall wall;
  wall.name = std::move(name);
  wall.point = wall.centre = point;
  wall.normal = (1.0 / Length(normal)) * normal;
  return wall;
}

Wall MakeMeshWall(std::string name, TriangleMesh mesh) {
  Wall wall;
  wall.name = std::move(name);
  wall.mesh = std::move(mesh);
  return wall;
}

}  // namespace calib::dem
