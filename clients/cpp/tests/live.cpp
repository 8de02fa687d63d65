// One agent of a live server walks to a goal, on a character whose bones are read back: live http://localhost:8080
// With "lost" as a second argument, the connection breaks once on the way, and no frame may be missing.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <thread>
#include <wayfarer/session.hpp>

#include "golden.hpp"

using namespace wayfarer;

namespace {

void require(bool holds, const std::string& what) {
  if (!holds) throw std::runtime_error(what);
}

struct Character {
  golden::Case own;
  Retarget retarget;
  double most = 0;  // height of the ankle of a foot that stands

  Character(golden::Case found, const std::vector<float>& rest_offsets)
      : own(std::move(found)), retarget(map_bones(own.rig, own.humanoid), rest_offsets) {}

  /// Pose the file's own nodes, and read them back.
  Rig posed(const float* frame) {
    retarget.pose(frame, 0);
    std::vector<Node> nodes = own.rig.nodes();
    for (const int b : retarget.mapped()) nodes[static_cast<std::size_t>(retarget.node(b))].rotation = retarget.local(b);
    nodes[static_cast<std::size_t>(retarget.node(0))].position = retarget.hips();
    return Rig(nodes);
  }
};

}  // namespace

int main(int count, char** values) try {
  require(count >= 2, "live http://localhost:8080 [lost]");
  for (const char* wrong : {"localhost:8080", "http://", "http://a/b", "http://a:b"}) {
    try {
      Api{wrong};
      require(false, std::string(wrong) + " was taken as an address");
    } catch (const std::invalid_argument&) {
    }
  }
  try {
    Api("http://127.0.0.1:1").call("GET", "/v1/info");
    require(false, "nobody answered");
  } catch (const ApiError& error) {
    require(error.status == 0 && std::string(error.what()).find("no answer from 127.0.0.1:1: ") == 0, error.what());
  }
  constexpr double GOAL_X = 1.5, GOAL_Z = 2, PATIENCE = 60;
  double arrived = 0;
  int opened = 0;
  PlayedAgent* walker = nullptr;
  std::vector<Character> characters;
  SessionOptions options;
  options.wish = {{"encoding", "smallest_three"}, {"fps", "20"}};
  options.on.added = [&](PlayedAgent& played) {
    walker = &played;
    for (golden::Case& own : golden::cases())
      if (own.name == "a_pose" || own.name == "vrm1" || own.name == "centimetres")
        characters.emplace_back(std::move(own), played.agent.rest_offsets);
  };
  std::uint64_t first_seq = 0, next_seq = 0;
  options.on.chunk = [&](PlayedAgent&, const Chunk& chunk) {
    if (next_seq == 0) first_seq = chunk.seq;
    next_seq = chunk.seq + 1;
  };
  options.on.event = [&](const Event& event) {
    if (event.kind == EventKind::path_done) arrived = event.at;
  };
  options.stream.status = [&](const std::string& status, const std::string& detail) {
    opened += status == "open";
    if (status == "lost") std::printf("lost: %s\n", detail.c_str());
  };
  options.stream.ended = [](const std::string& reason) { require(false, "the stream ended: " + reason); };
  Session session = Session::open(values[1], options);
  try {
    session.api().set_goal("nobody", {{"position", {{"x", 1}, {"y", 0}, {"z", 1}}}});
    require(false, "an agent that does not exist took a goal");
  } catch (const ApiError& error) {
    require(error.status == 404 && std::string(error.what()).find("nobody") != std::string::npos, error.what());
  }
  const golden::Case tall = golden::cases()[1];  // an agent with the legs of a character
  const Json body = session.api().fit_body(map_bones(tall.rig, tall.humanoid));
  require(body.at("betas").size() == 10 && std::abs(body.at("scale").get<double>() - 1) < 0.2, body.dump());
  const std::string id =
      session.create_agents({{{"name", "Ada"}, {"gender", body.at("gender")}, {"betas", body.at("betas")}}})[0].at("agent_id");
  session.api().set_path(id, {{{"position", {{"x", GOAL_X}, {"y", 0}, {"z", GOAL_Z}}}}});

  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(PATIENCE);
  while (std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(16));
    session.update();
    if (!walker || !walker->shown) continue;
    for (Character& character : characters) {
      const Rig posed = character.posed(walker->frame.data());
      for (int leg = 0; leg < 2; ++leg) {
        const int ankle = bone_number(leg ? "right_ankle" : "left_ankle");
        const double high = posed.place(character.retarget.node(ankle)).y;
        if (walker->track.contacts() >> leg & 1) character.most = std::max(character.most, high);
      }
    }
    // the event is ahead of the picture by the playout delay, and a last step may follow
    if (arrived > 0 && session.player().moment() > arrived + 0.5 && walker->track.contacts() == 3) break;
  }
  require(arrived > 0, "it has not arrived");
  require(walker->agent.id == id && walker->agent.name == "Ada", "another agent came");
  for (Character& character : characters) {
    const Rig posed = character.posed(walker->frame.data());
    const Vec3 hips = posed.place(character.retarget.node(0));
    const std::string& name = character.own.name;
    require(std::hypot(hips.x - GOAL_X, hips.z - GOAL_Z) < 0.5, name + ": the hips are not at the goal");
    // the ratio is that of the thigh joints, and hips sink a little for short legs: the traces hold it to a digit
    require(std::abs(hips.y / (character.retarget.ratio() * walker->frame[1]) - 1) < 0.04, name + ": hips' height");
    for (const char* ankle : {"left_ankle", "right_ankle"}) {
      const double high = posed.place(character.retarget.node(bone_number(ankle))).y;
      require(high > 0.03 && high < 0.2, name + ": an ankle is " + std::to_string(high) + " m high");
    }
    require(character.most > 0 && character.most < 0.3, name + ": a standing foot is in the air");
    std::printf("%s: walked to %.2f, %.2f\n", name.c_str(), hips.x, hips.z);
  }
  const PlayerStats& stats = session.player().stats();
  std::printf("{\"messages\": %llu, \"chunks\": %llu, \"gaps\": %llu, \"underruns\": %zu}\n",
              static_cast<unsigned long long>(stats.messages), static_cast<unsigned long long>(stats.chunks),
              static_cast<unsigned long long>(stats.gaps), session.player().underruns());
  require(opened == (count > 2 ? 2 : 1), "the stream was opened " + std::to_string(opened) + " times");
  require(stats.gaps == 0 && stats.chunks > 0, "frames are missing");
  require(next_seq == first_seq + stats.chunks, "chunks are missing");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
