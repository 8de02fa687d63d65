// Messages of a stream: their content, and refusals.

#include <doctest/doctest.h>

#include "golden.hpp"

using namespace wayfarer;
using golden::Bytes;
using golden::message;

namespace {

MessageKind decode(StreamDecoder& decoder, const Bytes& bytes) { return decoder.decode(bytes.data(), bytes.size()); }

void refused(const Bytes& bytes, const char* why) {
  CAPTURE(why);
  StreamDecoder decoder;
  CHECK_THROWS_WITH_AS(decode(decoder, bytes), doctest::Contains(why), DecodeError);
}

MessageKind give(MotionPlayer& player, const std::string& name, double now) {
  const Bytes bytes = message(name);
  return player.receive(bytes.data(), bytes.size(), now);
}

}  // namespace

TEST_CASE("a header gives rate, basis, skeleton and encoding") {
  StreamDecoder decoder;
  CHECK(decode(decoder, message("header")) == MessageKind::header);
  CHECK(decoder.sent_at() == 1780000000.2);
  const Header& header = decoder.header();
  CHECK(header.server_version == "1.2.3");
  CHECK(header.session_id == "s-1");
  CHECK((header.fps == 40 && header.sent_fps == 40 && header.encoding == F32_LE && header.frame_bytes == 44));
  CHECK((header.basis == "gltf" && header.metres_per_unit == 1 && !header.resumed));
  CHECK((header.skeleton[0].name == "pelvis" && header.skeleton[0].parent == -1));
  CHECK((header.skeleton[1].name == "left_hip" && header.skeleton[1].parent == 0));
  CHECK(header.bones == std::vector<std::uint32_t>{0, 1});
  decode(decoder, message("header_small"));
  CHECK((decoder.header().encoding == SMALLEST_THREE && decoder.header().sent_fps == 10 && decoder.header().resumed));
}

TEST_CASE("a batch gives new agents, chunks and removals") {
  StreamDecoder decoder;
  const Bytes bytes = message("batch");
  CHECK(decode(decoder, bytes) == MessageKind::batch);
  REQUIRE(decoder.added().size() == 1);
  const Agent& agent = decoder.added()[0];
  CHECK((agent.id == "a-7" && agent.alias == 300 && agent.name == "Zoë" && agent.body == "anny52"));
  CHECK((agent.gender == "male" && agent.seed == 4294967295 && agent.betas == std::vector{0.5, -1.25, 3.0}));
  CHECK(agent.rest_offsets == std::vector<float>{0, 1, 2});
  CHECK(decoder.removed() == std::vector<std::uint64_t>{1, 300});
  CHECK(decoder.resume_token() == "r.1.41");
  REQUIRE(decoder.chunks() == 2);
  const Chunk first = decoder.chunk(0), second = decoder.chunk(1);
  CHECK((first.alias == 300 && first.seq == 12 && first.first_frame == 96 && first.frames == 3));
  CHECK((first.scheduled_at == 1780000000.123456 && first.goal_revision == 3 && first.waypoint == 2));
  CHECK((first.state == AgentState::walking && first.flags == (flag::FIRST | flag::ARRIVED) && first.candidates == 8));
  CHECK(Bytes(first.contacts, first.contacts + 3) == Bytes{1, 3, 2});
  std::vector<float> frames(33);
  unpack_poses(first.poses, 3, F32_LE, 2, frames.data());
  CHECK(std::vector<float>(frames.begin() + 22, frames.end()) ==
        std::vector<float>{2, 2.5, 2.25, 0, 0, 0, 1, 0.5, -0.5, 0.5, -0.5});
  CHECK((second.alias == 7 && second.seq == 0 && second.state == AgentState::standing));
  unpack_poses(second.poses, 1, F32_LE, 2, frames.data());
  CHECK(frames[0] == 3);
}

TEST_CASE("an event says what happened to which agent; a heartbeat nothing") {
  StreamDecoder decoder;
  CHECK(decode(decoder, message("event")) == MessageKind::event);
  const Event& event = decoder.event();
  CHECK((event.kind == EventKind::goal_reached && name_of(event.kind) == "goal_reached"));
  CHECK((event.agent_id == "a-7" && event.alias == 300 && event.at == 1780000000.123456));
  CHECK((event.goal_revision == 3 && event.waypoint == 2 && event.detail == "goal 3 of 4 reached"));
  decode(decoder, message("batch"));
  CHECK(decode(decoder, message("heartbeat")) == MessageKind::heartbeat);
  CHECK((decoder.chunks() == 0 && decoder.added().empty() && decoder.removed().empty()));
  CHECK(decoder.resume_token() == "r.1.41");  // all except this is of the last message
}

TEST_CASE("malformed messages are refused in words") {
  refused({0x1a, 6, 0x12, 4, 0x0a, 2, 1, 2}, "columns of chunks differ in length");  // two aliases, nothing else
  refused({0x0b}, "wire type 3 in place of 0");
  refused({0x00, 1}, "field number 0");
  refused({0x08, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff}, "more than 10 bytes");
  refused({0x08, 0x80}, "ends in a number");
  refused({0x1a, 0x7f, 0}, "passes its end");
  Bytes whole = message("batch");
  whole.pop_back();
  refused(whole, "malformed");
  CHECK_THROWS_WITH_AS(frame_bytes(9, 22), doctest::Contains("encoding 9 is not known: this client is older"),
                       DecodeError);
}

TEST_CASE("unknown fields of every wire type are skipped") {
  StreamDecoder decoder;  // fields 20 to 23: varint -1, fixed64, block, fixed32; then field 1 = 5
  const Bytes unknown{0xa0, 0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01, 0xa9, 0x01, 1, 2, 3, 4,
                      5,    6,    7,    8,    0xb2, 0x01, 2,    7,    7,    0xbd, 0x01, 1,    2,    3,    4, 0x08, 5};
  CHECK(decode(decoder, unknown) == MessageKind::none);
  CHECK(decoder.sent_at() == 5e-6);
}

TEST_CASE("a player shows agents, reports them, and counts") {
  std::vector<std::string> heard;
  PlayerEvents on;
  on.header = [&](const Header&, bool again) { heard.push_back(again ? "header again" : "header"); };
  on.added = [&](PlayedAgent& played) { heard.push_back("added " + played.agent.id); };
  on.removed = [&](PlayedAgent& played) { heard.push_back("removed " + played.agent.id); };
  on.chunk = [&](PlayedAgent& played, const Chunk& chunk) {
    heard.push_back("chunk " + played.agent.id + " " + std::to_string(chunk.seq));
  };
  on.event = [&](const Event& event) { heard.push_back(std::string(name_of(event.kind))); };
  MotionPlayer player(on);
  CHECK_THROWS_WITH_AS(give(player, "batch", 0), "motion came before the header", DecodeError);
  give(player, "header", 0);
  CHECK(give(player, "batch", 0) == MessageKind::batch);
  CHECK(heard == std::vector<std::string>{"header", "added a-7", "chunk a-7 12", "removed a-7"});
  CHECK((player.stats().messages == 3 && player.stats().chunks == 2 && player.stats().frames == 6));
  CHECK_THROWS_WITH_AS(give(player, "batch_small", 0), "36 bytes of poses are not 2 frames of 44 bytes", DecodeError);
  player.begin();
  CHECK_THROWS_AS(give(player, "batch", 0), DecodeError);
  give(player, "header_small", 0.1);
  give(player, "batch_small", 0.1);
  player.advance(0.2);
  REQUIRE(player.agents().size() == 1);
  const PlayedAgent& zoe = player.agents().at(300);
  CHECK((zoe.shown && zoe.state == AgentState::standing && zoe.frame.size() == 7));
  CHECK((player.stats().gaps == 1 && player.stats().held == 1 && player.resume_token() == "r.1.42"));
  give(player, "event", 0.2);
  CHECK(heard.back() == "goal_reached");
  player.clear();
  CHECK((player.agents().empty() && heard.back() == "removed a-7"));
}

TEST_CASE("a header with tiers, a batch of roots, and hidden agents") {
  StreamDecoder decoder;
  decode(decoder, message("header_tiers"));
  const auto& tiers = decoder.header().tiers;
  REQUIRE(tiers.size() == 3);
  CHECK((tiers[1].radius == 30.5 && tiers[1].encoding == SMALLEST_THREE && tiers[1].sent_fps == 20));
  CHECK((tiers[1].bones == std::vector<std::uint32_t>{1} && tiers[1].frame_bytes == 18));
  CHECK((tiers[2].encoding == ROOT && tiers[2].bones.empty() && tiers[2].frame_bytes == 16));
  decode(decoder, message("batch_root"));
  CHECK((decoder.tier() == 2 && decoder.hidden() == std::vector<std::uint64_t>{7, 1000}));
  decode(decoder, message("header"));
  CHECK((decoder.header().tiers.size() == 1 && decoder.tier() == 0 && decoder.hidden().empty()));
  // header { pose_encoding: ROOT, sent_fps: 10, frame_bytes: 16 }
  decode(decoder, Bytes{0x12, 6, 0x30, 4, 0x38, 10, 0x48, 16});
  CHECK((decoder.header().bones.size() == 22 && decoder.header().tiers[0].bones.empty()));
}

TEST_CASE("a player shows all tiers alike, and removes hidden agents") {
  std::vector<std::string> told;
  PlayerEvents on;
  on.added = [&](PlayedAgent& played) { told.push_back("+" + played.agent.id); };
  on.removed = [&](PlayedAgent& played) { told.push_back((played.hidden ? "hidden " : "-") + played.agent.id); };
  MotionPlayer player(on);
  give(player, "header_tiers", 0);
  give(player, "batch_root", 0);
  player.advance(0.1);
  const PlayedAgent& played = player.agents().at(300);
  REQUIRE((played.shown && played.tier == 2 && played.frame.size() == 11));
  CHECK((played.frame[0] == 0 && played.frame[1] == 0.5f && played.frame[2] == 0.25f));
  const Bytes hiding{0x1a, 4, 0x32, 2, 0xac, 2};  // batch { hidden: [300] }
  player.receive(hiding.data(), hiding.size(), 1);
  CHECK(told == std::vector<std::string>{"+a-7", "hidden a-7"});
  give(player, "batch_root", 1);
  CHECK(told.back() == "+a-7");
  MotionPlayer plain;
  give(plain, "header", 0);
  CHECK_THROWS_WITH_AS(give(plain, "batch_root", 0), doctest::Contains("1 tiers, not of 2"), DecodeError);
}

TEST_CASE("an agent that comes nearer continues, and one that was not introduced is not shown") {
  std::vector<std::string> told;
  PlayerEvents on;
  on.added = [&](PlayedAgent& played) { told.push_back("+" + played.agent.id); };
  on.removed = [&](PlayedAgent& played) { told.push_back("-" + played.agent.id); };
  MotionPlayer player(on);
  give(player, "header_tiers", 0);
  give(player, "batch_closer", 0);
  CHECK(player.agents().empty());
  give(player, "batch_root", 0);
  CHECK(player.agents().at(300).tier == 2);
  give(player, "batch_closer", 0.2);
  player.advance(0.3);
  CHECK((player.agents().at(300).shown && player.agents().at(300).tier == 1));
  const Bytes hiding{0x1a, 4, 0x32, 2, 0xac, 2};  // batch { hidden: [300] }
  player.receive(hiding.data(), hiding.size(), 0.4);
  give(player, "batch_closer", 0.4);
  CHECK(player.agents().empty());
  CHECK(told == std::vector<std::string>{"+a-7", "-a-7"});
}
