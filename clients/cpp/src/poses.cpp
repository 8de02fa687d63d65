#include "wayfarer/poses.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

namespace wayfarer {
namespace {

constexpr int MIDDLE = 16383;  // the count that stands for 0
const double STEP = 1 / (MIDDLE * std::sqrt(2.0));

std::uint32_t word(const std::uint8_t* at) { return static_cast<std::uint32_t>(at[0] | at[1] << 8); }

float single(const std::uint8_t* at) {
  const std::uint32_t bits = word(at) | word(at + 2) << 16;
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

void read_smallest(const std::uint8_t* at, float* out) {
  const std::uint32_t left_out = word(at) >> 15 | word(at + 2) >> 15 << 1;
  double squares = 0;
  std::uint32_t k = 0;
  for (int n = 0; n < 3; ++n, ++k) {
    if (k == left_out) ++k;
    const double value = (static_cast<int>(word(at + 2 * n) & 0x7fff) - MIDDLE) * STEP;
    out[k] = static_cast<float>(value);
    squares += value * value;
  }
  out[left_out] = static_cast<float>(std::sqrt(std::max(0.0, 1 - squares)));
}

std::size_t rotation_bytes(std::uint32_t encoding) {
  switch (encoding) {
    case F32_LE: return 16;
    case SMALLEST_THREE: return 6;
    default:
      throw DecodeError("pose encoding " + std::to_string(encoding) +
                        " is not known: this client is older than the server");
  }
}

}  // namespace

std::size_t frame_bytes(std::uint32_t encoding, std::size_t bones) {
  return encoding == ROOT ? 16 : 12 + rotation_bytes(encoding) * bones;
}

void unpack_poses(const std::uint8_t* bytes, std::size_t count, std::uint32_t encoding,
                  std::size_t bones, float* out) {
  const std::size_t each = rotation_bytes(encoding);
  for (std::size_t frame = 0; frame < count; ++frame) {
    for (int k = 0; k < 3; ++k) *out++ = single(bytes + 4 * k);
    bytes += 12;
    for (std::size_t bone = 0; bone < bones; ++bone, bytes += each, out += 4) {
      if (encoding == F32_LE) {
        for (int k = 0; k < 4; ++k) out[k] = single(bytes + 4 * k);
      } else {
        read_smallest(bytes, out);
      }
    }
  }
}

}  // namespace wayfarer
