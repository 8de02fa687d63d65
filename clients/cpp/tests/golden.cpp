#include "golden.hpp"

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "golden_json.hpp"

namespace golden {
namespace {

const Json& retargeting() {
  static const Json document = json("retarget.json");
  return document;
}

}  // namespace

Bytes bytes(const std::string& name) {
  std::ifstream file(GOLDEN_FOLDER "/" + name, std::ios::binary);
  if (!file) throw std::runtime_error("no file " GOLDEN_FOLDER "/" + name);
  return {std::istreambuf_iterator<char>(file), {}};
}

Bytes message(const std::string& name) {
  static const Json all = json("messages.json");
  return from_hex(all.at(name));
}

Bytes from_hex(const std::string& hex) {
  Bytes found;
  for (std::size_t k = 0; k < hex.size(); k += 2)
    found.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(k, 2), nullptr, 16)));
  return found;
}

Walk walk(const std::string& basis) {
  const Json& all = retargeting().at("walk").at(basis);
  Walk found{flat<float>(all.at("rest_offsets")), {}};
  for (std::size_t k = 0; k < all.at("hips").size(); ++k)
    found.frames.push_back(flat<float>({all.at("hips")[k], all.at("rotations")[k]}));
  return found;
}

wayfarer::Rig rig(const Json& rows) {
  std::vector<wayfarer::Node> nodes;
  for (const Json& node : rows)
    nodes.push_back({node.at("name"), node.at("parent"), vec3(node.at("position")), quat(node.at("rotation")),
                     vec3(node.at("scale"))});
  return wayfarer::Rig(std::move(nodes));
}

std::vector<Case> cases() {
  std::vector<Case> found;
  for (const Json& entry : retargeting().at("cases")) {
    std::map<std::string, int> humanoid;
    if (!entry.at("humanoid").is_null()) humanoid = entry.at("humanoid").get<std::map<std::string, int>>();
    found.push_back({entry.at("name"), entry.at("basis"), rig(entry.at("nodes")), std::move(humanoid)});
  }
  return found;
}

}  // namespace golden
