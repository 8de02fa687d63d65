#include "model.hpp"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace wayfarer {
namespace {

using Json = nlohmann::json;

constexpr int SCHEMA = 1;

std::string file_at(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be read; `wayfarer export --for engines` writes it");
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<float> floats(const std::string& bytes, const Json& part, const std::string& file) {
  const std::size_t offset = part.at("offset"), size = part.at("bytes");
  if (offset + size > bytes.size()) throw std::runtime_error(file + ": is cut short");
  std::vector<float> values(size / sizeof(float));
  std::memcpy(values.data(), bytes.data() + offset, size);
  return values;
}

std::vector<std::string> names(const Json& tensors) {
  std::vector<std::string> found;
  for (const Json& tensor : tensors) found.push_back(tensor.at("name"));
  return found;
}

}  // namespace

LocalModel LocalModel::read(const std::string& folder) {
  return {file_at(folder + "/wayfarer.json"), [&](const std::string& file) { return file_at(folder + "/" + file); }};
}

LocalModel::LocalModel(std::string_view sidecar, const std::function<std::string(const std::string&)>& body) try {
  const auto parts = std::make_shared<Parts>();
  const Json about = Json::parse(sidecar);
  if (about.at("schema") != SCHEMA || about.at("seed_frames") != local::SEED ||
      about.at("frames_per_step") != local::FRAMES || about.at("joints").size() != local::JOINTS)
    throw std::runtime_error("wayfarer.json: another schema than this version reads (1)");
  if (about.at("candidates") != 1)
    throw std::runtime_error("wayfarer.json: the graph takes several candidates; export it with 1");
  parts->inputs = names(about.at("inputs"));
  parts->outputs = names(about.at("outputs"));
  for (const Json& input : about.at("inputs")) {
    auto& shape = parts->shapes.emplace_back();
    for (const Json& size : input.at("shape")) shape.push_back(size.is_string() ? 0 : size.get<std::int64_t>());
  }
  for (std::size_t k = 0; k < parts->modes.size(); ++k) {
    const Json& mode = about.at("modes").at(local::MODES[k]);
    parts->modes[k] = {mode.at("term_weights").get<std::vector<float>>(), mode.at("policy"), mode.at("temperature"),
                       mode.at("own")};
  }
  for (const auto& [name, constant] : about.at("steering").items()) parts->steering[name] = constant.at("value");
  const Json& soles = about.at("sole_markers");
  for (std::size_t k = 0; k < parts->soles.size(); ++k)
    parts->soles[k] = soles.at(k / local::SOLES).at(k % local::SOLES);
  const auto markers = about.at("markers").get<std::vector<std::string>>();
  parts->shares = local::shares_of(markers);
  parts->leg_shares = local::leg_shares(markers);
  parts->mirrored_markers = about.at("mirrored_markers").get<std::vector<std::size_t>>();
  parts->mirrored_joints = about.at("mirrored_joints").get<std::vector<std::size_t>>();
  for (const auto& [gender, layout] : about.at("bodies").items()) {
    const std::string file = layout.at("file"), bytes = body(file);
    std::map<std::string, std::vector<float>> values;
    for (const Json& part : layout.at("parts")) values[part.at("name")] = floats(bytes, part, file);
    parts->bodies.emplace(gender, local::Body(std::move(values)));
  }
  parts_ = parts;
} catch (const Json::exception& error) {
  throw std::runtime_error(std::string("wayfarer.json: ") + error.what());
}

const std::vector<std::string>& LocalModel::inputs() const { return parts_->inputs; }
const std::vector<std::string>& LocalModel::outputs() const { return parts_->outputs; }

namespace local {

std::array<Vec3, JOINTS> Body::bones(const Betas& betas) const {
  const std::vector<Vec3> found = shaped("bones", betas);
  std::array<Vec3, JOINTS> bones;
  std::copy_n(found.begin(), JOINTS, bones.begin());
  return bones;
}

Legs Body::legs(const Betas& betas) const {
  const std::array<Vec3, JOINTS> joints = bones(betas);
  const std::vector<Vec3> ankle = shaped("sole_of_ankle", betas), ball = shaped("sole_of_ball", betas);
  const std::vector<float>& share = part("ball_share");
  Legs legs;
  for (std::size_t side = 0; side < 2; ++side) {
    legs.hip[side] = joints[1 + side];
    legs.knee[side] = joints[4 + side];
    legs.ankle[side] = joints[7 + side];
    legs.ball[side] = joints[10 + side];
    for (std::size_t p = 0; p < SOLES; ++p) {
      legs.sole_of_ankle[side][p] = ankle.at(SOLES * side + p);
      legs.sole_of_ball[side][p] = ball.at(SOLES * side + p);
      legs.ball_share[side][p] = share.at(SOLES * side + p);
    }
  }
  legs.measure();
  return legs;
}

Seed Body::stand(std::size_t pose, const Betas& betas, const SoleMarkers& soles, Point place, double heading) const {
  const std::size_t count = part("start_markers").size() / poses() / 3;
  std::vector<Vec3> markers = shaped("start_markers", betas, count * pose, count);
  double low = markers[static_cast<std::size_t>(soles[0])].z;
  for (const int sole : soles) low = std::min(low, markers[static_cast<std::size_t>(sole)].z);
  for (Vec3& marker : markers) {
    const Point p = place + turned(floor_of(marker), heading);
    marker = rounded(Vec3{p.x, p.y, marker.z - low});
  }
  Turns turns;
  const float* given = &part("start_rotations")[4 * JOINTS * pose];
  for (std::size_t j = 0; j < JOINTS; ++j, given += 4) turns[j] = {given[0], given[1], given[2], given[3]};
  turns[0] = rounded(multiply(about_z(heading), turns[0]));
  Seed seed;
  for (std::size_t s = 0; s < SEED; ++s) {
    seed.hips[s] = rounded(Vec3{place.x, place.y, -low});
    seed.turns[s] = turns;
    seed.markers.insert(seed.markers.end(), markers.begin(), markers.end());
  }
  return seed;
}

const std::vector<float>& Body::part(const std::string& name) const {
  const auto found = parts_.find(name);
  if (found == parts_.end()) throw std::runtime_error("wayfarer.json: the bodies have no " + name);
  return found->second;
}

// points that are linear in betas, those from a number on
std::vector<Vec3> Body::shaped(const std::string& name, const Betas& betas, std::size_t from, std::size_t count) const {
  const std::vector<float>&mean = part(name), &dirs = part(name + "_dirs");
  const auto value = [&](std::size_t k) {
    double sum = mean.at(k);
    for (std::size_t b = 0; b < betas.size(); ++b) sum += dirs.at(betas.size() * k + b) * betas[b];
    return sum;
  };
  std::vector<Vec3> points;
  for (std::size_t k = 3 * from; k < 3 * (from + count); k += 3) points.push_back({value(k), value(k + 1), value(k + 2)});
  return points;
}

std::vector<Vec3> Body::shaped(const std::string& name, const Betas& betas) const {
  return shaped(name, betas, 0, part(name).size() / 3);
}

}  // namespace local
}  // namespace wayfarer
