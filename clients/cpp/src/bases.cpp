#include "wayfarer/bases.hpp"

#include <stdexcept>
#include <string>
#include <utility>

namespace wayfarer {

double Basis::heading(const Quat& rotation) const {
  const Vec3 ahead = rotate(rotation, forward);
  return std::atan2(dot(ahead, cross(up, forward)), dot(ahead, forward));
}

const Basis& basis_named(std::string_view name) {
  static constexpr std::pair<std::string_view, const Basis*> ALL[]{
      {"gltf", &bases::gltf},       {"unity", &bases::unity},
      {"unreal", &bases::unreal},   {"unreal_mannequin", &bases::unreal_mannequin},
      {"blender", &bases::blender}, {"ros", &bases::ros}};
  std::string names;
  for (const auto& [known, basis] : ALL) {
    if (known == name) return *basis;
    names += (names.empty() ? "" : ", ") + std::string(known);
  }
  throw std::invalid_argument("\"" + std::string(name) + "\" is no basis; bases are " + names);
}

}  // namespace wayfarer
