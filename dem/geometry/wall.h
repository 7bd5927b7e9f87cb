#pragma once
// Rigid pieces of the boundary: where they are, how they move, what they do to grains that touch
// them.

#include <optional>
#include <string>
#include <vector>

#include "dem/geometry/triangle_mesh.h"

namespace calib::dem {

/// One rigid piece: a mesh (both sides of which are solid, without thickness), or an infinite plane
/// that keeps grains on the side its normal points to.
struct Wall {
  std::string name;
  TriangleMesh mesh;      ///< vertices where they are now [m]; empty: a plane
  Vec3 point, normal;     ///< of the plane: any point of it [m], unit vector
  bool active = true;     ///< false: not there (an opened trapdoor)
  Vec3 velocity;          ///< of `centre` [m/s]; a plane moves without turning
  Vec3 angular_velocity;  ///< about `centre` [rad/s]
  Vec3 centre;            ///< moves with the wall [m]
  Vec3 surface_velocity;  ///< of a conveyor: the surface runs, the wall stays [m/s]
  std::optional<double>
      friction;  ///< tan(phi) against grains; unset: the friction of the model's walls

  [[nodiscard]] bool IsPlane() const { return mesh.triangle.empty(); }
  [[nodiscard]] bool Moves() const {
    return Dot(velocity, velocity) > 0 || Dot(angular_velocity, angular_velocity) > 0;
  }

  /// Velocity of the wall's surface at a place [m/s].
  [[nodiscard]] Vec3 VelocityAt(const Vec3& place) const {
    return velocity + Cross(angular_velocity, place - centre) + surface_velocity;
  }

  /// For archives: all state.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(name, mesh.vertex, mesh.triangle, point, normal, active, velocity, angular_velocity,
            centre, surface_velocity, friction);
  }

  /// Moves it on by dt [s]. Turning is by the rational rotation of angle 2 atan(w dt/2), so that it
  /// needs no sine and a mesh keeps its shape to rounding.
  void Move(double dt);
};

/// A wall at rest that is an infinite plane through `point` [m]. normal: towards the grains, of any
/// length > 0.
Wall MakePlane(std::string name, const Vec3& point, const Vec3& normal);

/// A wall at rest that is a mesh; its `centre` is the origin.
Wall MakeMeshWall(std::string name, TriangleMesh mesh);

}  // namespace calib::dem
