// A made-up stream: people who walk, as a server would send them.
#pragma once

#include <cstring>

#include "golden.hpp"

namespace crowd {

using golden::Bytes;

inline void varint(Bytes& out, std::uint64_t value) {
  for (; value >= 128; value /= 128) out.push_back(static_cast<std::uint8_t>(value % 128 + 128));
  out.push_back(static_cast<std::uint8_t>(value));
}

inline void number(Bytes& out, std::uint64_t field, std::uint64_t value) {
  varint(out, field * 8);
  varint(out, value);
}

inline void block(Bytes& out, std::uint64_t field, const Bytes& bytes) {
  varint(out, field * 8 + 2);
  varint(out, bytes.size());
  out.insert(out.end(), bytes.begin(), bytes.end());
}

inline void text(Bytes& out, std::uint64_t field, const std::string& value) {
  block(out, field, Bytes(value.begin(), value.end()));
}

template <class Value>  // (number of an agent) → value
void column(Bytes& out, std::uint64_t field, std::size_t count, Value value) {
  Bytes packed;
  for (std::size_t k = 0; k < count; ++k) varint(packed, value(k));
  block(out, field, packed);
}

inline void floats(Bytes& out, const std::vector<float>& values) {
  for (const float value : values) {
    std::uint32_t bits;
    std::memcpy(&bits, &value, 4);
    for (int k = 0; k < 4; ++k) out.push_back(static_cast<std::uint8_t>(bits >> (8 * k)));
  }
}

/// The first message: 22 bones in F32_LE at 40 fps.
inline Bytes header() {
  Bytes fields, basis, message;
  number(fields, 3, 40);
  number(basis, 1, 1);
  block(fields, 4, basis);
  number(fields, 6, 1);
  number(fields, 7, 40);
  column(fields, 8, 22, [](std::size_t k) { return k; });
  number(fields, 9, 364);
  number(message, 1, 1000000000000000);
  block(message, 2, fields);
  return message;
}

/// Batch `seq` of `count` agents: 8 frames of each. The first introduces them.
inline Bytes batch(const golden::Walk& walk, std::size_t count, std::size_t seq) {
  const std::uint64_t at = 1000000000000000 + 200000 * seq;
  Bytes chunks, poses, fields, message;
  for (std::size_t agent = 0; agent < count; ++agent) {
    for (std::size_t f = 0; f < 8; ++f) {
      std::vector<float> frame = walk.frames[(seq + f + agent) % walk.frames.size()];
      frame[0] += static_cast<float>(agent);
      floats(poses, frame);
    }
    if (seq) continue;
    Bytes introduced, offsets;
    text(introduced, 1, "agent-" + std::to_string(agent));
    number(introduced, 2, agent + 1);
    floats(offsets, walk.rest_offsets);
    block(introduced, 15, offsets);
    block(fields, 1, introduced);
  }
  const auto all = [](std::uint64_t value) { return [value](std::size_t) { return value; }; };
  column(chunks, 1, count, [](std::size_t k) { return k + 1; });
  column(chunks, 2, count, all(seq));
  column(chunks, 3, count, all(8 * seq));
  column(chunks, 4, count, all(at));
  for (const std::uint64_t field : {5u, 6u, 7u, 10u, 11u}) column(chunks, field, count, all(field == 6 ? 2u : 0u));
  block(chunks, 8, poses);
  block(chunks, 9, Bytes(8 * count, 3));
  block(fields, 2, chunks);
  text(fields, 4, "epoch." + std::to_string(seq));
  number(message, 1, at);
  block(message, 3, fields);
  return message;
}

}  // namespace crowd
