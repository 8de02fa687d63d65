// A reader for protobuf messages, as much as the motion stream needs.
// https://protobuf.dev/programming-guides/encoding/
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "wayfarer/poses.hpp"

namespace wayfarer {

/// Reads the fields of one message; an embedded message has its own reader. Never reads beyond its bytes.
class ProtoReader {
 public:
  ProtoReader(const std::uint8_t* bytes, std::size_t size) : at_(bytes), end_(bytes + size) {}

  /// Move to the next field; its number, or 0 at the end of the message.
  std::uint64_t next() {
    if (at_ == end_) return 0;
    const std::uint64_t tag = raw();
    wire_type_ = static_cast<int>(tag & 7);
    if (tag >> 3 == 0) malformed("field number 0");
    return tag >> 3;
  }

  std::uint64_t varint() {
    expect(0);
    return raw();
  }

  std::uint32_t uint32() {
    const std::uint64_t value = varint();
    if (value > 0xffffffff) malformed("a number above 2^32");
    return static_cast<std::uint32_t>(value);
  }

  /// Negative ones come as 10 bytes, two's complement of 64 bits.
  std::int32_t int32() { return static_cast<std::int32_t>(static_cast<std::uint32_t>(varint())); }

  double number() {
    expect(1);
    return fixed<double>();
  }

  /// A field of bytes.
  const std::uint8_t* block(std::size_t& size) {
    expect(2);
    const std::uint64_t length = raw();
    if (length > left()) malformed("a field passes its end");
    size = static_cast<std::size_t>(length);
    at_ += size;
    return at_ - size;
  }

  ProtoReader message() {
    std::size_t size;
    const std::uint8_t* bytes = block(size);
    return {bytes, size};
  }

  void string(std::string& into) {
    std::size_t size;
    const std::uint8_t* bytes = block(size);
    into.assign(reinterpret_cast<const char*>(bytes), size);
  }

  /// Append a repeated field, packed or one at a time.
  void varints(std::vector<std::uint64_t>& into) {
    if (wire_type_ != 2) return into.push_back(varint());
    ProtoReader packed = message();
    while (packed.left()) into.push_back(packed.raw());
  }

  template <class T>  // float or double
  void numbers(std::vector<T>& into) {
    if (wire_type_ != 2) {
      expect(sizeof(T) == 8 ? 1 : 5);
      return into.push_back(fixed<T>());
    }
    ProtoReader packed = message();
    if (packed.left() % sizeof(T)) malformed("broken packed field");
    while (packed.left()) into.push_back(packed.fixed<T>());
  }

  /// Skip the value of a field that is not needed.
  void skip() {
    std::size_t size;
    if (wire_type_ == 0) raw();
    else if (wire_type_ == 1) fixed<std::uint64_t>();
    else if (wire_type_ == 2) block(size);
    else if (wire_type_ == 5) fixed<std::uint32_t>();
    else malformed("wire type " + std::to_string(wire_type_));
  }

 private:
  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

  [[noreturn]] static void malformed(const std::string& what) {
    throw DecodeError("malformed message: " + what);
  }

  void expect(int wire_type) const {
    if (wire_type_ == wire_type) return;
    malformed("wire type " + std::to_string(wire_type_) + " in place of " + std::to_string(wire_type));
  }

  std::uint64_t raw() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 70; shift += 7) {
      if (at_ == end_) malformed("it ends in a number");
      const std::uint8_t byte = *at_++;
      value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    malformed("a number has more than 10 bytes");
  }

  template <class T>
  T fixed() {
    if (left() < sizeof(T)) malformed("a field passes its end");
    std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t> bits = 0;
    for (std::size_t k = 0; k < sizeof(T); ++k) bits |= static_cast<decltype(bits)>(*at_++) << (8 * k);
    T value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  const std::uint8_t *at_, *end_;
  int wire_type_ = 0;
};

}  // namespace wayfarer
