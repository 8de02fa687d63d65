#include "wayfarer/messages.hpp"

#include <limits>
#include <numeric>

#include "protobuf.hpp"

namespace wayfarer {
namespace {

constexpr std::string_view STATES[]{"unknown", "standing", "walking", "stopping", "turning"};
constexpr std::string_view EVENTS[]{
    "unknown",     "goal_reached", "path_done",  "gap",             "draining",  "model_changed",
    "unreachable", "blocked",      "goal_moved", "behaviour_ended", "agent_left",
    "fault"};
constexpr std::string_view BASIS_NAMES[]{"gltf", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"};

/// Names of numbers that a later server may have more of.
template <std::size_t N>
std::string_view named(const std::string_view (&names)[N], std::uint64_t number, std::string_view other) {
  return number < N ? names[number] : other;
}

template <class Enum, std::size_t N>
Enum known(const std::string_view (&)[N], std::uint64_t number) {
  return number < N ? static_cast<Enum>(number) : Enum::unknown;
}

double seconds(std::uint64_t micros) { return static_cast<double>(static_cast<std::int64_t>(micros)) / 1e6; }

Bone read_bone(ProtoReader reader) {
  Bone bone;
  while (const auto field = reader.next()) {
    if (field == 1) reader.string(bone.name);
    else if (field == 2) bone.parent = reader.int32();
    else reader.skip();
  }
  return bone;
}

void read_skeleton(ProtoReader reader, std::vector<Bone>& skeleton) {
  while (const auto field = reader.next()) {
    if (field == 1) skeleton.push_back(read_bone(reader.message()));
    else reader.skip();
  }
}

void read_basis(ProtoReader reader, Header& header) {
  while (const auto field = reader.next()) {
    if (field == 1) header.basis = named(BASIS_NAMES, reader.varint(), "unknown");
    else if (field == 2) header.metres_per_unit = reader.number();
    else reader.skip();
  }
}

Tier read_tier(ProtoReader reader) {
  Tier tier;
  std::vector<std::uint64_t> bones;
  while (const auto field = reader.next()) {
    if (field == 1) tier.radius = reader.number();
    else if (field == 2) tier.encoding = reader.uint32();
    else if (field == 3) tier.sent_fps = reader.uint32();
    else if (field == 4) reader.varints(bones);
    else if (field == 5) tier.frame_bytes = reader.uint32();
    else reader.skip();
  }
  tier.bones.assign(bones.begin(), bones.end());
  return tier;
}

Header read_header(ProtoReader reader) {
  Header header;
  std::vector<std::uint64_t> bones;
  while (const auto field = reader.next()) {
    if (field == 1) reader.string(header.server_version);
    else if (field == 2) reader.string(header.session_id);
    else if (field == 3) header.fps = reader.uint32();
    else if (field == 4) read_basis(reader.message(), header);
    else if (field == 5) read_skeleton(reader.message(), header.skeleton);
    else if (field == 6) header.encoding = reader.uint32();
    else if (field == 7) header.sent_fps = reader.uint32();
    else if (field == 8) reader.varints(bones);
    else if (field == 9) header.frame_bytes = reader.uint32();
    else if (field == 11) header.resumed = reader.varint() != 0;
    else if (field == 12) header.tiers.push_back(read_tier(reader.message()));
    else reader.skip();
  }
  header.bones.assign(bones.begin(), bones.end());
  if (header.tiers.empty()) {
    Tier only;
    only.encoding = header.encoding;
    only.sent_fps = header.sent_fps;
    only.bones = header.bones;
    only.frame_bytes = header.frame_bytes;
    header.tiers.push_back(std::move(only));
  }
  if (header.encoding == ROOT) {  // drawn with the bones of a body
    header.bones.resize(22);
    std::iota(header.bones.begin(), header.bones.end(), 0u);
  }
  return header;
}

Agent read_agent(ProtoReader reader) {
  Agent agent;
  while (const auto field = reader.next()) {
    if (field == 1) reader.string(agent.id);
    else if (field == 2) agent.alias = reader.uint32();
    else if (field == 4) reader.string(agent.name);
    else if (field == 5) reader.string(agent.body);
    else if (field == 6) agent.gender = reader.varint() == 2 ? "male" : "female";
    else if (field == 7) reader.numbers(agent.betas);
    else if (field == 8) agent.seed = reader.varint();
    else if (field == 15) reader.numbers(agent.rest_offsets);
    else reader.skip();
  }
  return agent;
}

/// Reads into an event whose strings keep their memory.
void read_event(ProtoReader reader, Event& event) {
  event.kind = EventKind::unknown;
  event.agent_id.clear();
  event.detail.clear();
  event.alias = event.goal_revision = event.waypoint = 0;
  event.at = 0;
  while (const auto field = reader.next()) {
    if (field == 1) event.kind = known<EventKind>(EVENTS, reader.varint());
    else if (field == 2) reader.string(event.agent_id);
    else if (field == 3) event.alias = reader.uint32();
    else if (field == 4) event.at = seconds(reader.varint());
    else if (field == 5) event.goal_revision = reader.uint32();
    else if (field == 6) event.waypoint = reader.uint32();
    else if (field == 7) reader.string(event.detail);
    else reader.skip();
  }
}

}  // namespace

std::string_view name_of(AgentState state) {
  return named(STATES, static_cast<std::uint32_t>(state), "unknown");
}

std::string_view name_of(EventKind kind) {
  return named(EVENTS, static_cast<std::uint32_t>(kind), "unknown");
}

MessageKind StreamDecoder::decode(const std::uint8_t* message, std::size_t size) {
  ProtoReader reader(message, size);
  kind_ = MessageKind::none;
  sent_at_ = 0;
  added_.clear();
  removed_.clear();
  hidden_.clear();
  tier_ = 0;
  for (auto& column : columns_) column.clear();
  poses_ = contacts_ = nullptr;
  poses_size_ = contacts_size_ = 0;
  while (const auto field = reader.next()) {
    if (field == 1) {
      sent_at_ = seconds(reader.varint());
    } else if (field == 2) {
      header_ = read_header(reader.message());
      kind_ = MessageKind::header;
    } else if (field == 3) {
      batch(reader.message());
      kind_ = MessageKind::batch;
    } else if (field == 4) {
      reader.skip();
      kind_ = MessageKind::heartbeat;
    } else if (field == 5) {
      read_event(reader.message(), event_);
      kind_ = MessageKind::event;
    } else {
      reader.skip();
    }
  }
  check();
  return kind_;
}

void StreamDecoder::batch(ProtoReader reader) {
  while (const auto field = reader.next()) {
    if (field == 1) added_.push_back(read_agent(reader.message()));
    else if (field == 2) chunk_columns(reader.message());
    else if (field == 3) reader.varints(removed_);
    else if (field == 4) reader.string(token_);
    else if (field == 5) tier_ = reader.uint32();
    else if (field == 6) reader.varints(hidden_);
    else reader.skip();
  }
}

void StreamDecoder::chunk_columns(ProtoReader reader) {
  while (const auto field = reader.next()) {
    if (field == 1) reader.varints(columns_[ALIAS]);
    else if (field == 2) reader.varints(columns_[SEQ]);
    else if (field == 3) reader.varints(columns_[FIRST_FRAME]);
    else if (field == 4) reader.varints(columns_[SCHEDULED_AT]);
    else if (field == 5) reader.varints(columns_[GOAL_REVISION]);
    else if (field == 6) reader.varints(columns_[STATE]);
    else if (field == 7) reader.varints(columns_[FLAGS]);
    else if (field == 8) poses_ = reader.block(poses_size_);
    else if (field == 9) contacts_ = reader.block(contacts_size_);
    else if (field == 10) reader.varints(columns_[WAYPOINT]);
    else if (field == 11) reader.varints(columns_[CANDIDATES]);
    else reader.skip();
  }
}

void StreamDecoder::check() const {
  const std::size_t count = chunks() ? chunks() : 1;
  bool equal = poses_size_ % count == 0 && contacts_size_ % count == 0;
  for (const auto& column : columns_) equal = equal && column.size() == chunks();
  if (!equal) throw DecodeError("malformed message: columns of chunks differ in length");
  for (const int column : {ALIAS, GOAL_REVISION, FLAGS, WAYPOINT, CANDIDATES})
    for (const auto value : columns_[static_cast<std::size_t>(column)])
      if (value > std::numeric_limits<std::uint32_t>::max())
        throw DecodeError("malformed message: a number above 2^32");
}

Chunk StreamDecoder::chunk(std::size_t row) const {
  const auto small = [&](std::size_t column) { return static_cast<std::uint32_t>(columns_[column][row]); };
  Chunk chunk;
  chunk.alias = small(ALIAS);
  chunk.seq = columns_[SEQ][row];
  chunk.first_frame = columns_[FIRST_FRAME][row];
  chunk.scheduled_at = seconds(columns_[SCHEDULED_AT][row]);
  chunk.goal_revision = small(GOAL_REVISION);
  chunk.state = known<AgentState>(STATES, columns_[STATE][row]);
  chunk.flags = small(FLAGS);
  chunk.waypoint = small(WAYPOINT);
  chunk.candidates = small(CANDIDATES);
  chunk.frames = contacts_size_ / chunks();
  if (chunk.frames) {
    chunk.poses = poses_ + poses_size_ / chunks() * row;
    chunk.contacts = contacts_ + chunk.frames * row;
  }
  return chunk;
}

void StreamDecoder::check_frames(const Header& header) const {
  if (tier_ >= header.tiers.size())
    throw DecodeError("the header tells of " + std::to_string(header.tiers.size()) + " tiers, not of " +
                      std::to_string(tier_));
  const Tier& tier = header.tiers[tier_];
  const std::size_t each = frame_bytes(tier.encoding, tier.bones.size());
  if (poses_size_ == each * contacts_size_) return;
  throw DecodeError(std::to_string(poses_size_) + " bytes of poses are not " +
                    std::to_string(contacts_size_) + " frames of " + std::to_string(each) + " bytes");
}

}  // namespace wayfarer
