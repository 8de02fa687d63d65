#include "wayfarer/rig.hpp"

#include <stdexcept>

namespace wayfarer {
namespace {

Vec3 each(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

}  // namespace

Rig::Rig(std::vector<Node> nodes) : nodes_(std::move(nodes)), children_(nodes_.size()) {
  const int count = static_cast<int>(nodes_.size());
  for (int k = 0; k < count; ++k) {
    const Node& own = node(k);
    if (own.parent < -1 || own.parent >= k)
      throw std::invalid_argument("node " + std::to_string(k) + " (" + own.name +
                                  "): its parent must stand before it");
    const Quat turn = normalized(own.rotation);
    if (own.parent < 0) {
      rotations_.push_back(turn);
      places_.push_back(own.position);
      scales_.push_back(own.scale);
      continue;
    }
    children_[static_cast<std::size_t>(own.parent)].push_back(k);
    const Quat above = rotation(own.parent);
    const Vec3 size = scale(own.parent);
    rotations_.push_back(multiply(above, turn));
    places_.push_back(place(own.parent) + rotate(above, each(size, own.position)));
    scales_.push_back(each(size, own.scale));
  }
}

std::vector<int> Rig::ancestors(int k) const {
  std::vector<int> found;
  while ((k = node(k).parent) >= 0) found.push_back(k);
  return found;
}

}  // namespace wayfarer
