// The files of tests/golden as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "golden.hpp"

namespace golden {

using Json = nlohmann::json;

inline Json json(const std::string& name) {
  const Bytes text = bytes(name);
  return Json::parse(text.begin(), text.end());
}

/// All numbers of nested lists, in order.
template <class T>
std::vector<T> flat(const Json& lists) {
  std::vector<T> found;
  if (!lists.is_array()) return {lists.get<T>()};
  for (const Json& entry : lists)
    for (const T value : flat<T>(entry)) found.push_back(value);
  return found;
}

inline wayfarer::Vec3 vec3(const Json& v) { return {v[0], v[1], v[2]}; }
inline wayfarer::Quat quat(const Json& q) { return {q[0], q[1], q[2], q[3]}; }
/// A rig of rows of nodes.
wayfarer::Rig rig(const Json& rows);

}  // namespace golden
