// Packed frames to numbers; docs/wire-format.md shows each encoding byte by byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>

namespace wayfarer {

/// A message of the stream cannot be read; the connection is of no more use.
struct DecodeError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline constexpr std::uint32_t F32_LE = 1, SMALLEST_THREE = 3, ROOT = 4;

/// Numbers of an unpacked frame: hips x, y, z, then x, y, z, w per bone.
constexpr std::size_t frame_width(std::size_t bones) { return 3 + 4 * bones; }

/// Bytes of a packed frame. Throws DecodeError when the encoding is not known.
std::size_t frame_bytes(std::uint32_t encoding, std::size_t bones);

/// Unpack `count` frames, frame_bytes · count bytes, into frame_width · count floats. Allocates nothing.
void unpack_poses(const std::uint8_t* bytes, std::size_t count, std::uint32_t encoding,
                  std::size_t bones, float* out);

}  // namespace wayfarer
