// The vectors and traces that every client follows: tests/golden/README.md.

#include <cmath>
#include <doctest/doctest.h>

#include "golden_json.hpp"

using namespace wayfarer;
using golden::Json;

namespace {

template <class Found>
void near(const Found& found, const Json& wanted, double within) {
  const auto numbers = golden::flat<double>(wanted);
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    CAPTURE(k);
    REQUIRE(std::abs(found[k] - numbers[k]) <= within);
  }
}

std::array<double, 3> list(const Vec3& v) { return {v.x, v.y, v.z}; }

/// q and -q are the same rotation.
void near_turn(const Quat& found, const Json& wanted, double within) {
  const Quat q = golden::quat(wanted);
  const double sign = found.x * q.x + found.y * q.y + found.z * q.z + found.w * q.w < 0 ? -1 : 1;
  near(std::array{sign * found.x, sign * found.y, sign * found.z, sign * found.w}, wanted, within);
}

Quat turn_at(const float* q) { return {q[0], q[1], q[2], q[3]}; }

double degrees_between(const float* a, const Json& b) {
  const auto distance = [&](double sign) {
    double squares = 0;
    for (std::size_t k = 0; k < 4; ++k) squares += std::pow(a[k] - sign * b[k].get<float>(), 2);
    return std::sqrt(squares);
  };
  return 4 * std::asin(std::min(distance(1), distance(-1)) / 2) * 180 / 3.141592653589793;
}

}  // namespace

TEST_CASE("every packing of poses, in every basis") {
  const Json document = golden::json("vectors.json");
  const std::map<std::string, std::uint32_t> encodings{
      {"f32_le", F32_LE}, {"smallest_three", SMALLEST_THREE}};
  const Json identity{0, 0, 0, 1};
  CHECK(document.at("vectors").size() == 40);
  for (const Json& vector : document.at("vectors")) {
    CAPTURE(vector.at("name").get<std::string>());
    const std::uint32_t encoding = encodings.at(vector.at("encoding"));
    const Json &bones = vector.at("bones"), &wanted = document.at("bases").at(vector.at("basis"));
    const auto bytes = golden::bytes(vector.at("poses"));
    const std::size_t count = vector.at("frames").size(), width = frame_width(bones.size());
    REQUIRE(frame_bytes(encoding, bones.size()) == vector.at("frame_bytes"));
    REQUIRE(bytes.size() == frame_bytes(encoding, bones.size()) * count);
    std::vector<float> frames(count * width);
    unpack_poses(bytes.data(), count, encoding, bones.size(), frames.data());
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t number = vector.at("frames")[k];
      const float* frame = &frames[width * k];
      for (std::size_t n = 0; n < 3; ++n) REQUIRE(frame[n] == wanted.at("translation")[number][n].get<float>());
      for (std::size_t b = 0; b < bones.size(); ++b) {
        const Json& rotations = wanted.at("rotations")[number];
        const std::size_t bone = bones[b];
        const Json& rotation = bone < rotations.size() ? rotations[bone] : identity;
        REQUIRE(degrees_between(frame + 3 + 4 * b, rotation) <=
                document.at("tolerance_deg").at(vector.at("encoding")).get<double>());
      }
    }
  }
}

TEST_CASE("tiers without all bones, in every basis") {
  const Json document = golden::json("tiers.json");
  for (const Json& own : document.at("cases")) {
    CAPTURE(own.at("basis").get<std::string>());
    Header header;
    header.basis = own.at("basis");
    header.bones = own.at("bones").get<std::vector<std::uint32_t>>();
    Tier first;
    first.encoding = F32_LE;
    first.sent_fps = 40;
    first.bones = header.bones;
    header.tiers.push_back(first);
    for (const Json& tier : own.at("tiers")) {
      Tier next;
      next.encoding = tier.at("encoding");
      next.sent_fps = tier.at("sent_fps");
      next.bones = tier.at("bones").get<std::vector<std::uint32_t>>();
      header.tiers.push_back(next);
    }
    TierUnpacker unpacker(header);
    for (std::size_t k = 1; k < header.tiers.size(); ++k) {
      const Json& tier = own.at("tiers")[k - 1];
      const auto bytes = golden::from_hex(tier.at("poses"));
      const std::size_t count = bytes.size() / tier.at("frame_bytes").get<std::size_t>();
      REQUIRE(frame_bytes(header.tiers[k].encoding, header.tiers[k].bones.size()) == tier.at("frame_bytes"));
      std::vector<float> frames(91 * count);
      unpacker.unpack(bytes.data(), count, k, frames.data());
      const auto hips = golden::flat<double>(tier.at("hips"));
      const Json& rotations = tier.at("rotations");
      for (std::size_t frame = 0; frame < count; ++frame) {
        for (std::size_t n = 0; n < 3; ++n) REQUIRE(std::abs(frames[91 * frame + n] - hips[3 * frame + n]) < 1e-3);
        for (std::size_t bone = 0; bone < 22; ++bone) {
          CAPTURE(bone);
          const std::size_t at = 88 * frame + 4 * bone;
          const Json wanted{rotations[at], rotations[at + 1], rotations[at + 2], rotations[at + 3]};
          near_turn(turn_at(&frames[91 * frame + 3 + 4 * bone]), wanted, 1e-3);
        }
      }
    }
  }
}

TEST_CASE("playout clock") {
  const Json traces = golden::json("playout.json").at("clock");
  for (const auto& trace : traces.items()) {
    CAPTURE(trace.key());
    PlayoutClock clock;
    for (const Json& event : trace.value()) {
      const double now = event[1];
      CAPTURE(now);
      if (event[0] == "message") clock.observe(now, event[2]);
      else if (event[0] == "chunk") clock.observe_chunk(now, event[2]);
      else if (event[0] == "resumed") clock.resumed(event[2]);
      else {
        const double moment = clock.advance(now);
        near(std::array{moment, clock.delay(now)}, {event[2], event[3]}, 1e-6);
      }
    }
  }
}

TEST_CASE("pose track") {
  const Json traces = golden::json("playout.json").at("track");
  for (const auto& trace : traces.items()) {
    CAPTURE(trace.key());
    PoseTrack track(11);
    float pose[11];
    for (const Json& event : trace.value()) {
      const double time = event[1];
      CAPTURE(time);
      if (event[0] == "push") {
        const auto frames = golden::flat<float>(event[3]);
        const auto contacts = event[4].get<golden::Bytes>();
        track.push(time, event[2], frames.data(), contacts.size(), contacts.data());
        continue;
      }
      const Json& wanted = event[2];
      REQUIRE(track.sample(time, pose) == !wanted.is_null());
      if (wanted.is_null()) continue;
      near(pose, {wanted[0], wanted[1], wanted[2]}, 1e-5);
      for (const std::size_t k : {3u, 7u})
        near_turn(turn_at(pose + k), {wanted[k], wanted[k + 1], wanted[k + 2], wanted[k + 3]}, 1e-5);
      CHECK(track.contacts() == event[3]);
      CHECK(std::abs(track.buffered(time) - event[4].get<double>()) < 1e-6);
      CHECK(track.underruns() == event[5]);
    }
  }
}

TEST_CASE("smooth root") {
  SmoothRoot root(bases::gltf);
  const Json events = golden::json("playout.json").at("root");
  for (const Json& event : events) {
    auto frame = golden::flat<float>(event[1]);
    for (const float value : golden::flat<float>(event[2])) frame.push_back(value);
    root.update(event[0], frame.data(), event[3]);
    near(list(root.point()), event[4], 1e-5);
    CHECK(std::abs(root.heading() - event[5].get<double>()) < 1e-5);
  }
}

TEST_CASE("retarget") {
  const Json document = golden::json("retarget.json");
  REQUIRE(document.at("bones").get<std::vector<std::string>>() ==
          std::vector<std::string>(BONES.begin(), BONES.end()));
  CHECK(document.at("cases").size() >= 15);
  const auto cases = golden::cases();
  for (std::size_t n = 0; n < cases.size(); ++n) {
    const golden::Case& own = cases[n];
    const Json& found = document.at("cases")[n];
    CAPTURE(own.name);
    const Basis& basis = basis_named(own.basis);
    const BoneMap map = map_bones(own.rig, own.humanoid, basis);
    CHECK(map.found_by() == found.at("found_by"));
    const auto rows = map.table();
    CHECK(std::map<std::string, std::string>(rows.begin(), rows.end()) == found.at("map"));
    const golden::Walk walk = golden::walk(own.basis);
    std::optional<Soles> soles;
    if (!found.at("mesh").is_null()) {
      std::vector<Vec3> places;
      for (const Json& place : found.at("mesh").at("places")) places.push_back(golden::vec3(place));
      soles = measure_soles(map, places, found.at("mesh").at("nodes").get<std::vector<int>>(), basis);
      REQUIRE(soles);
      CHECK(std::abs(soles->floor - found.at("floor").get<double>()) < 1e-5);
    }
    Retarget retarget(map, walk.rest_offsets, basis, NAN, soles ? &*soles : nullptr);
    CHECK(retarget.loose().size() == found.at("poses")[0].at("moved").size());
    CHECK(std::abs(retarget.ratio() - found.at("ratio").get<double>()) < 1e-5);
    const double unit = own.basis.rfind("unreal", 0) == 0 ? 100 : 1;
    for (std::size_t k = 0; k < found.at("poses").size(); ++k) {
      const Json& pose = found.at("poses")[k];
      retarget.pose(walk.frames[k].data());
      for (int b = 0; b < BONE_COUNT; ++b) {
        const std::string bone(BONES[static_cast<std::size_t>(b)]);
        CAPTURE(bone);
        REQUIRE(pose.at("places").contains(bone) == (retarget.node(b) >= 0));
        if (retarget.node(b) < 0) continue;
        near(list(retarget.place(b)), pose.at("places").at(bone), 1e-4 * unit);
        near_turn(retarget.rotation(b), pose.at("rotations").at(bone), 1e-4);
        if (pose.at("moved").contains(bone))
          near(list(retarget.moved(b)), pose.at("moved").at(bone), 1e-4 * (own.name == "centimetres" ? 100 : unit));
      }
    }
  }
}

TEST_CASE("what cannot walk on two legs is refused") {
  const Json document = golden::json("retarget.json");
  for (const Json& refused : document.at("refused")) {
    CAPTURE(refused.at("name"));
    std::string said;
    try {
      map_bones(golden::rig(refused.at("nodes")));
    } catch (const std::invalid_argument& error) {
      said = error.what();
    }
    CAPTURE(said);
    CHECK(said.find(refused.at("says").get<std::string>()) != std::string::npos);
  }
}

TEST_CASE("rigs that others made: no bone is missing") {
  const Json rigs = golden::json("foreign_rigs.json").at("rigs");
  for (const auto& rig : rigs.items()) {
    CAPTURE(rig.key());
    const Json& bones = rig.value();
    const double half = std::sqrt(0.5);
    std::vector<Node> nodes{{"Armature", -1, {}, {-half, 0, 0, half}}};
    for (const Json& bone : bones) {
      const int parent = bone[1];
      Vec3 place = golden::vec3(bone[2]);
      if (parent >= 0) place = place - golden::vec3(bones[static_cast<std::size_t>(parent)][2]);
      nodes.push_back({bone[0], parent + 1, place});
    }
    const BoneMap map = map_bones(Rig(nodes));
    CHECK(map.found_by() == "names");
    CHECK(map.missing().empty());
  }
}
