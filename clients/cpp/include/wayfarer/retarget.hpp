// A stream's poses on a character of any skeleton: clients/README.md, "Retargeting". Nothing here knows the axes of
// the character's bones: its T-pose follows from the places of its joints.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "wayfarer/bone_map.hpp"
#include "wayfarer/soles.hpp"

namespace wayfarer {

/// Joints of a character at rest, upright in a basis of its handedness: what `Api::fit_body` sends. `floor`: height of
/// its floor; NaN where nothing is known of its soles, and it does not stand on the origin's level.
struct CharacterJoints {
  std::array<Vec3, BONE_COUNT> places{};  // of the bones that the map has
  double floor = std::numeric_limits<double>::quiet_NaN();
};
CharacterJoints character_joints(const BoneMap& map, const Basis& basis = bases::gltf, const Soles* soles = nullptr);

/// Turns frames of an agent into poses of a character.
class Retarget {
 public:
  /// `rest_offsets` of the agent, three numbers a bone; `floor`: height of the character's soles at rest; `soles`:
  /// found in its mesh (measure_soles). All in the stream's basis and unit, as is the character's own space. Throws
  /// std::invalid_argument.
  Retarget(const BoneMap& map, const std::vector<float>& rest_offsets, const Basis& basis = bases::gltf,
           double floor = std::numeric_limits<double>::quiet_NaN(), const Soles* soles = nullptr);

  /// A frame of the stream (hips x, y, z, then x, y, z, w of the 22 bones and any more) on the character. `ground`:
  /// height of the ground there; NaN: that of the lower sole. Allocates nothing.
  void pose(const float* frame, double ground = std::numeric_limits<double>::quiet_NaN());

  /// Numbers of the bones that the character has, parents first.
  const std::vector<int>& mapped() const { return mapped_; }
  /// Node of a bone; -1 when the character lacks it.
  int node(int bone) const { return nodes_[at(bone)]; }
  /// The last pose: rotations and places in the world, and relative to the nodes' parents.
  const Quat& rotation(int bone) const { return world_[at(bone)]; }
  const Vec3& place(int bone) const { return places_[at(bone)]; }
  const Quat& local(int bone) const { return local_[at(bone)]; }
  const Vec3& hips() const { return moved_[0]; }
  /// Bones whose places must be set, too (the hips, and bones that hang from another bone than they follow), and their
  /// places relative to the nodes' parents.
  const std::vector<int>& loose() const { return loose_; }
  const Vec3& moved(int bone) const { return moved_[at(bone)]; }
  /// Height of the character's thigh joints by that of the agent's.
  double ratio() const { return ratio_; }
  /// Height of the ground of the last pose: that which was given, or of the lower sole.
  double ground() const { return ground_; }

 private:
  template <class T>
  using PerBone = std::array<T, BONE_COUNT>;
  struct Sole {  // a foot in the T-pose, from the ankle's joint; `toes` turn with the toes about `joint`, from it
    Vec3 heel, ball, joint;
    std::vector<Vec3> fixed, toes;
  };
  struct Parent {  // of a bone's node, in the axes of the bone that it hangs from
    Quat turn{};
    Vec3 place{}, scale{1, 1, 1};
  };
  struct Leg {
    Sole sole, source_sole;
    Vec3 stance;       // how much wider than the agent's
    Vec3 tip;          // from the toes' joint: as far before it and as low as the toes reach
    double length = 0;  // from thigh joint to ankle along the bones
    double clear = 0;  // height of the agent's sole
    Vec3 goal;         // where the ankle goes
    double most = 0;   // how far it may be from the thigh joint
    double stays = 0;  // 1 for a foot on the ground, 0 for one that has left it
  };

  static std::size_t at(int bone) { return static_cast<std::size_t>(bone); }
  bool has(int bone) const { return nodes_[at(bone)] >= 0; }
  PerBone<Quat> corrections(const PerBone<Vec3>& place) const;
  void measure_legs(const PerBone<Vec3>& place, const PerBone<Quat>& correct, double floor, const Soles* soles);
  Sole sole_of(const Vec3& toe, double height) const;
  void pose_source(const float* frame);
  Vec3 lowest(const Sole& sole, int leg, double& height) const;
  void put();
  Vec3 goal_of(int leg, double sole) const;
  void flex(int leg, double low);
  double reach(int leg) const;
  double lacks(int leg) const;
  void raise(int leg);
  void bend(int leg);
  Vec3 within(const Vec3& start, const Vec3& goal, double most, double least) const;
  void relate();

  Basis basis_;
  PerBone<int> nodes_, above_{}, hangs_{};  // of each bone: its node, the bone that it follows, and that it hangs from
  std::vector<int> mapped_, loose_;
  PerBone<Vec3> offsets_{}, source_rest_{};  // of the agent
  PerBone<Quat> rest_{};                     // of each bone in the T-pose
  PerBone<Vec3> offset_{};                   // of each bone, in the axes of the one above
  PerBone<Parent> parents_{};
  Vec3 thighs_{};  // the middle of the thigh joints from the hips' node, in its axes
  std::array<Leg, 2> legs_{};
  double ratio_ = 1, ground_ = 0;
  PerBone<Quat> turns_{};  // of the agent's frame, in the world
  PerBone<Vec3> source_{};
  PerBone<Quat> world_{}, local_{};
  PerBone<Vec3> places_{}, moved_{};
};

}  // namespace wayfarer
