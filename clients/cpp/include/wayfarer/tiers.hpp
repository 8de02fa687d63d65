// Frames of each tier of a stream, as poses with the bones of the first: clients/README.md, "Far people".
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "wayfarer/messages.hpp"
#include "wayfarer/quaternions.hpp"

namespace wayfarer {

/// Unpacks the frames of one stream. Allocates nothing once the longest chunk has come.
class TierUnpacker {
 public:
  /// Throws DecodeError when the header cannot be read.
  explicit TierUnpacker(const Header& header);

  /// Unpack `count` frames of a tier into `width` · `count` floats.
  void unpack(const std::uint8_t* bytes, std::size_t count, std::size_t tier, float* out);

 private:
  struct Packing {
    std::uint32_t encoding;
    std::size_t bones;
    bool whole;              // the bones of the first tier
    std::vector<int> slots;  // place of each of them in a frame of this tier; -1: none
  };
  void standing(std::uint32_t bone, float* out) const;
  void root(const std::uint8_t* bytes, float* out) const;

  std::vector<std::uint32_t> bones_;
  std::vector<Packing> tiers_;
  std::vector<Quat> stand_, cycle_;  // in the stream's basis
  Vec3 up_;
  std::vector<float> scratch_;
};

}  // namespace wayfarer
