// The bases a session may choose (docs/wire-format.md), as its clients need them.
#pragma once

#include <string_view>

#include "wayfarer/quaternions.hpp"

namespace wayfarer {

/// Unit vectors of a body at heading 0; `handed` is 1 when the axes are right-handed, -1 when left-handed.
struct Basis {
  Vec3 left, up, forward;
  double handed;

  /// Angle about `up` by which a rotation turns `forward`, radians.
  double heading(const Quat& rotation) const;
  /// The part of a vector that lies along the ground.
  Vec3 level(const Vec3& v) const { return without(v, up); }
};

namespace bases {
inline constexpr Basis gltf{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, 1};
inline constexpr Basis unity{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, -1};
inline constexpr Basis unreal{{0, -1, 0}, {0, 0, 1}, {1, 0, 0}, -1};
inline constexpr Basis unreal_mannequin{{1, 0, 0}, {0, 0, 1}, {0, 1, 0}, -1};
inline constexpr Basis blender{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}, 1};
inline constexpr Basis ros{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}, 1};
}  // namespace bases

/// The basis of an API name. Throws std::invalid_argument that lists the names.
const Basis& basis_named(std::string_view name);

}  // namespace wayfarer
