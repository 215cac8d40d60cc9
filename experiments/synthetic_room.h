// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace sweepfit {

// A soft dark patch on the floor under something that stands there.
struct ContactShadow {
  Eigen::Vector3d center_in_world;
  double radius = 0.1;  // metres, to exp(-1)
  double strength = 0.5;
};

// A square room with a tiled floor and panelled walls. Colours linear RGB.
class Room {
 public:
  // half_size: from the centre to the walls, metres. The room is the same at
  // every centre (it moves with it).
  Room(const Eigen::Vector3d& center_in_world, double half_size, unsigned seed);

  // What a ray from inside the room sees when nobody is there.
  Eigen::Vector3d Color(const Eigen::Vector3d& origin,
                        const Eigen::Vector3d& direction) const;
  // Share of that light that the shadows leave; 1 off the floor.
  double Shadow(const Eigen::Vector3d& origin,
                const Eigen::Vector3d& direction,
                const std::vector<ContactShadow>& shadows) const;
  // Floor, lower wall, upper wall.
  std::array<Eigen::Vector3d, 3> MainColors() const {
    return {floor_, wainscot_, wall_};
  }

 private:
  // The nearest of floor, ceiling and walls along a ray from inside; axis 0:
  // walls across x, 1: floor and ceiling, 2: walls across z.
  struct Hit {
    Eigen::Vector3d point;  // from the centre
    int axis;
  };
  Hit Trace(const Eigen::Vector3d& origin,
            const Eigen::Vector3d& direction) const;
  Eigen::Vector3d FloorColor(const Eigen::Vector3d& p) const;
  Eigen::Vector3d WallColor(double along, double height, int wall) const;

  Eigen::Vector3d center_;
  double half_size_;
  std::uint32_t noise_seed_;
  double tile_size_, panel_width_;
  Eigen::Vector3d floor_, wall_, wainscot_;
};

}  // namespace sweepfit
