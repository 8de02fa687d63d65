// Refusals, corrections and recovery, which the traces do not show.

#include <cmath>
#include <doctest/doctest.h>

#include "golden_json.hpp"

using namespace wayfarer;

namespace {

const std::vector<golden::Case>& cases() {
  static const auto found = golden::cases();
  return found;
}

void push(PoseTrack& track, double time, const std::vector<float>& xs) {
  std::vector<float> frames;
  for (const float x : xs) frames.insert(frames.end(), {x, 0, 0, 0, 0, 0, 1});
  track.push(time, 40, frames.data(), xs.size(), golden::Bytes(xs.size()).data());
}

}  // namespace

TEST_CASE("local rotations give the same places through the file's own nodes") {
  const golden::Walk walk = golden::walk("gltf");
  for (const golden::Case& own : cases()) {
    CAPTURE(own.name);
    if (own.basis != "gltf") continue;
    Retarget retarget(map_bones(own.rig, own.humanoid), walk.rest_offsets);
    for (const auto& frame : walk.frames) {
      retarget.pose(frame.data());
      std::vector<Node> nodes = own.rig.nodes();
      for (const int b : retarget.mapped())
        nodes[static_cast<std::size_t>(retarget.node(b))].rotation = retarget.local(b);
      for (const int b : retarget.loose())
        nodes[static_cast<std::size_t>(retarget.node(b))].position = retarget.moved(b);
      const Rig posed(nodes);
      for (const int b : retarget.mapped())
        REQUIRE(length(posed.place(retarget.node(b)) - retarget.place(b)) < 1e-6);
    }
  }
}

TEST_CASE("joints of a character stand upright in the basis that is asked for") {
  for (const golden::Case& own : cases()) {
    CAPTURE(own.name);
    for (const char* name : {"gltf", "unity", "unreal", "blender"}) {
      const Basis &basis = basis_named(name), &space = basis_named(own.basis);
      if (basis.handed != space.handed) continue;  // no rotation leads there
      const BoneMap map = map_bones(own.rig, own.humanoid, space);
      const CharacterJoints joints = character_joints(map, basis);
      const auto at = [&](const char* bone) { return joints.places[static_cast<std::size_t>(bone_number(bone))]; };
      const Vec3 up = at("left_hip") - at("left_ankle"), left = at("left_hip") - at("right_hip");
      CHECK(dot(up, basis.up) > 0.9 * length(up));
      CHECK(dot(left, basis.left) > 0.9 * length(left));
      if (map.nodes()[10] >= 0) CHECK(dot(at("left_foot") - at("left_ankle"), basis.forward) > 0);
    }
  }
}

TEST_CASE("a map can be shown and corrected") {
  const BoneMap map = map_bones(cases()[0].rig);
  CHECK((map.missing().empty() && map.table()[4].first == "left_knee"));
  const BoneMap other = map.corrected({{"spine2", std::nullopt}, {"neck", "head"}, {"head", std::nullopt}});
  CHECK(other.missing() == std::vector<std::string>{"spine2", "head"});
  CHECK(other.found_by() == "user");
  const auto refused = [&](const char* bone, std::optional<std::string> node, const char* why) {
    CHECK_THROWS_WITH_AS(map.corrected({{bone, node}}), doctest::Contains(why), std::invalid_argument);
  };
  refused("head", "nose", "head: the rig has no node \"nose\"");
  refused("tail", "head", "\"tail\" is no bone; bones are pelvis, left_hip");
  refused("left_knee", std::nullopt, "no node was found for left_knee, neither");
  refused("left_knee", "head", "left_knee: \"head\" is head, too");
  refused("spine3", "head", "spine3: \"head\" is head, too");
}

TEST_CASE("a map that failed is completed by corrections") {
  std::vector<Node> nodes;
  for (const Node& node : cases()[0].rig.nodes())  // nor by shape
    nodes.push_back({node.name == "left_knee" ? "x" : node.name, node.parent});
  const Rig rig(nodes);
  CHECK_THROWS_WITH_AS(map_bones(rig), doctest::Contains("no node was found for left_knee, neither"), std::invalid_argument);
  const BoneMap map = map_bones(rig, {}, bases::gltf, {{"left_knee", "x"}});
  CHECK((map.found_by() == "user" && map.missing().empty()));
}

TEST_CASE("a rig that is no humanoid is refused in words") {
  const Rig table({{"table"}, {"leg1", 0, {0, -1, 0}}, {"leg2", 0, {1, -1, 0}}});
  CHECK_THROWS_WITH_AS(map_bones(table), doctest::Contains("no node was found for pelvis, left_hip"),
                       std::invalid_argument);
  CHECK_THROWS_AS(map_bones(Rig({})), std::invalid_argument);
  CHECK_THROWS_WITH_AS(Rig({{"a", 0}}), "node 0 (a): its parent must stand before it", std::invalid_argument);
  CHECK_THROWS_AS(map_bones(table, {{"hips", 9}}), std::invalid_argument);
  CHECK_THROWS_WITH_AS(basis_named("unitty"), doctest::Contains("bases are gltf, unity"), std::invalid_argument);
  const BoneMap map = map_bones(cases()[0].rig);
  CHECK_THROWS_WITH_AS(Retarget(map, {1, 2, 3}), "rest offsets of 22 bones are needed", std::invalid_argument);
}

TEST_CASE("a heading is 0 forwards, and grows as a turn about up does") {
  for (const char* name : {"gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"}) {
    const Basis& basis = basis_named(name);
    CHECK(basis.handed == dot(cross(basis.left, basis.up), basis.forward));
    for (const double angle : {0.0, 1.0, -2.0, 3.0}) {
      const Vec3 axis = std::sin(angle / 2) * basis.up;
      CHECK(std::abs(basis.heading({axis.x, axis.y, axis.z, std::cos(angle / 2)}) - angle) < 1e-9);
    }
  }
}

TEST_CASE("an underrun holds the pose, and the stream is joined again without a jump") {
  PoseTrack track(7);
  float pose[7];
  CHECK(!track.sample(0, pose));
  push(track, 0, {0, 1});
  for (const double t : {0.0, 0.02, 0.1, 0.5}) track.sample(t, pose);
  CHECK((pose[0] == 1 && track.underruns() == 1 && track.held()));
  std::vector<float> later;
  for (int k = 0; k < 40; ++k) later.push_back(static_cast<float>(2 + k));
  push(track, 0.05, later);
  float last = pose[0];
  track.sample(0.51, pose);
  CHECK(std::abs(pose[0] - last) < 0.5);
  for (double t = 0.52; t < 0.75; t += 0.01) {
    track.sample(t, pose);
    CHECK(pose[0] >= last - 1e-3);
    last = pose[0];
  }
  CHECK(std::abs(pose[0] - (2 + (0.74 - 0.05) * 40)) < 0.5);
}

TEST_CASE("frames sent twice are dropped, and memory is bounded") {
  PoseTrack track(7);
  float pose[7];
  push(track, 0, {0, 1, 2, 3, 4, 5, 6, 7});
  push(track, 0, {9, 9, 9, 9, 9, 9, 9, 9});
  track.sample(0.1, pose);
  CHECK(pose[0] == 4);
  for (int k = 1; k < 1000; ++k) push(track, k * 0.2, {0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(track.size() == 400);
  CHECK(std::abs(track.buffered(999 * 0.2 + 0.175)) < 1e-6);
}

TEST_CASE("a machine that slept jumps to the present") {
  PlayoutClock clock;
  CHECK(clock.advance(100) == 100);  // nothing has come
  clock.observe(100, 0);
  const double before = clock.advance(100);
  clock.observe(400, 300);
  CHECK(clock.advance(400) - before > 299);
}

TEST_CASE("a call goes where the rule says") {
  const golden::Json document = golden::json("homes.json");
  for (const golden::Json& each : document.at("cases")) {
    CAPTURE(each.at("name").get<std::string>());
    Homes homes(each.at("entry"));
    for (const golden::Json& call : each.at("calls")) {
      Route route(homes, call.at("about"));
      const std::size_t count = call.at("called").size();
      for (std::size_t k = 0; k < count; ++k) {
        CAPTURE(k);
        REQUIRE(route.address() == call.at("called")[k].get<std::string>());
        const golden::Json& answer = call.at("answers")[k];
        const bool last = k + 1 == count;
        if (answer.contains("answered")) {
          CHECK((last && !call.at("fails").get<bool>()));
          route.answered(answer.at("answered"));
        } else if (answer.contains("unavailable")) {
          CHECK(route.unavailable() == !last);
        } else {
          const golden::Json& place = answer.at("misdirected");
          CHECK(route.misdirected(place[0], place[1]) == !last);
        }
      }
    }
    CHECK(homes.home(each.at("about")) == each.at("home").get<std::string>());
  }
  for (const golden::Json& each : document.at("reasons"))
    CHECK(place_of(each[0]) == std::pair<std::string, int>(each[1], each[2]));
}
