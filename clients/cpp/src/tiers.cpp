#include "wayfarer/tiers.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "gait_table.hpp"
#include "wayfarer/bases.hpp"

namespace wayfarer {
namespace {

constexpr std::size_t GAIT_BONES = 22, GAIT_POSES = 16, MOST_TIER_BONES = 1024;
constexpr double TURN_UNIT = 3.141592653589793 / 32768;

const Basis& basis_of(const Header& header) {
  return header.basis == "unknown" ? bases::gltf : basis_named(header.basis);
}

std::vector<Quat> turned(const float* table, std::size_t count, const Basis& basis) {
  std::vector<Quat> found;
  for (std::size_t k = 0; k < count; ++k, table += 4) {
    const Vec3 v = basis.handed * (static_cast<double>(table[0]) * basis.left +
                                   static_cast<double>(table[1]) * basis.up +
                                   static_cast<double>(table[2]) * basis.forward);
    found.push_back({v.x, v.y, v.z, static_cast<double>(table[3])});
  }
  return found;
}

/// Interpolates two rotations linearly along the shorter arc, normalised.
Quat mixed(const Quat& p, const Quat& q, double share) {
  const double cosine = p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w;
  const double from = 1 - share, to = cosine < 0 ? -share : share;
  return normalized(
      {from * p.x + to * q.x, from * p.y + to * q.y, from * p.z + to * q.z, from * p.w + to * q.w});
}

void put_turn(const Quat& q, float* out) {
  out[0] = static_cast<float>(q.x);
  out[1] = static_cast<float>(q.y);
  out[2] = static_cast<float>(q.z);
  out[3] = static_cast<float>(q.w);
}

}  // namespace

TierUnpacker::TierUnpacker(const Header& header)
    : bones_(header.bones),
      stand_(turned(gait_table::STAND, GAIT_BONES, basis_of(header))),
      cycle_(turned(gait_table::CYCLE, GAIT_POSES * GAIT_BONES, basis_of(header))),
      up_(basis_of(header).up) {
  for (const Tier& tier : header.tiers) {
    frame_bytes(tier.encoding, tier.bones.size());  // an unknown encoding throws at once
    if (tier.bones.size() > MOST_TIER_BONES) throw DecodeError(std::to_string(tier.bones.size()) + " bones are too many");
    if (!tier.sent_fps) throw DecodeError("the header says no frames per second");
    Packing packing{tier.encoding, tier.bones.size(), tier.bones == bones_, {}};
    for (const std::uint32_t bone : bones_) {
      const auto found = std::find(tier.bones.begin(), tier.bones.end(), bone);
      packing.slots.push_back(found == tier.bones.end() ? -1 : static_cast<int>(found - tier.bones.begin()));
    }
    tiers_.push_back(std::move(packing));
  }
}

void TierUnpacker::unpack(const std::uint8_t* bytes, std::size_t count, std::size_t tier, float* out) {
  const Packing& packing = tiers_.at(tier);
  const std::size_t width = frame_width(bones_.size());
  if (packing.encoding == ROOT) {
    for (std::size_t frame = 0; frame < count; ++frame) root(bytes + 16 * frame, out + width * frame);
    return;
  }
  if (packing.whole) return unpack_poses(bytes, count, packing.encoding, packing.bones, out);
  const std::size_t own = frame_width(packing.bones);
  if (scratch_.size() < own * count) scratch_.resize(own * count);
  unpack_poses(bytes, count, packing.encoding, packing.bones, scratch_.data());
  for (std::size_t frame = 0; frame < count; ++frame) {
    const float* from = scratch_.data() + own * frame;
    float* to = out + width * frame;
    std::copy(from, from + 3, to);
    for (std::size_t k = 0; k < bones_.size(); ++k) {
      const int slot = packing.slots[k];
      if (slot < 0) standing(bones_[k], to + 3 + 4 * k);
      else std::copy_n(from + 3 + 4 * slot, 4, to + 3 + 4 * k);
    }
  }
}

void TierUnpacker::standing(std::uint32_t bone, float* out) const {
  put_turn(bone < GAIT_BONES ? stand_[bone] : Quat{}, out);
}

void TierUnpacker::root(const std::uint8_t* bytes, float* out) const {
  unpack_poses(bytes, 1, F32_LE, 0, out);  // the hips
  const auto bits = static_cast<std::uint16_t>(bytes[12] | bytes[13] << 8);
  const double half = static_cast<std::int16_t>(bits) * TURN_UNIT / 2;
  const double phase = bytes[14] / 256.0 * GAIT_POSES;
  const double share = std::min(1.0, bytes[15] / 128.0 / static_cast<double>(gait_table::SWING));
  const auto pose = static_cast<std::size_t>(phase);
  for (std::size_t k = 0; k < bones_.size(); ++k) {
    const std::uint32_t bone = bones_[k];
    float* to = out + 3 + 4 * k;
    if (bone >= GAIT_BONES) {
      standing(bone, to);
      continue;
    }
    const Quat& before = cycle_[GAIT_BONES * pose + bone];
    const Quat& after = cycle_[GAIT_BONES * ((pose + 1) % GAIT_POSES) + bone];
    Quat q = mixed(stand_[bone], mixed(before, after, phase - static_cast<double>(pose)), share);
    if (bone == 0) {
      const Vec3 axis = std::sin(half) * up_;
      q = multiply({axis.x, axis.y, axis.z, std::cos(half)}, q);
    }
    put_turn(q, to);
  }
}

}  // namespace wayfarer
