// The files of tests/golden, without their JSON.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "wayfarer/core.hpp"

namespace golden {

using Bytes = std::vector<std::uint8_t>;

Bytes bytes(const std::string& name);
Bytes from_hex(const std::string& hex);
/// A message of messages.json.
Bytes message(const std::string& name);

/// Frames of a walking agent (91 numbers each), and its rest offsets.
struct Walk {
  std::vector<float> rest_offsets;
  std::vector<std::vector<float>> frames;
};
Walk walk(const std::string& basis);

/// A character of retarget.json.
struct Case {
  std::string name, basis;
  wayfarer::Rig rig;
  std::map<std::string, int> humanoid;
};
std::vector<Case> cases();

}  // namespace golden
