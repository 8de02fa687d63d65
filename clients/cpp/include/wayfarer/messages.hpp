// StreamMotionResponse (proto/wayfarer/v1/motion.proto), read from bytes. Times are seconds since 1970.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "wayfarer/poses.hpp"

namespace wayfarer {

/// Flags of a chunk; `Chunk::flags` is a sum of them.
namespace flag {
inline constexpr std::uint32_t FIRST = 1, REPLANNED = 2, ARRIVED = 4, GAP = 8, REDUCED = 16, HELD = 32;
}

enum class AgentState : std::uint32_t { unknown, standing, walking, stopping, turning };
enum class EventKind : std::uint32_t {
  unknown, goal_reached, path_done, gap, draining, model_changed, unreachable, blocked, goal_moved,
  behaviour_ended, agent_left, fault
};
enum class MessageKind { none, header, batch, heartbeat, event };

/// As in the API: "walking", "goal_reached".
std::string_view name_of(AgentState state);
std::string_view name_of(EventKind kind);

struct Bone {
  std::string name;
  int parent = 0;
};

/// How frames are packed in a ring around the viewpoints.
struct Tier {
  double radius = std::numeric_limits<double>::infinity();  // infinite without rings
  std::uint32_t encoding = 0, sent_fps = 0;
  std::vector<std::uint32_t> bones;
  std::uint32_t frame_bytes = 0;
};

/// Properties of a whole stream. `bones`: numbers in `skeleton` of the bones whose rotations are sent.
struct Header {
  std::string server_version, session_id;
  std::uint32_t fps = 0, sent_fps = 0;  // frames per second of the motion; sent per second
  std::string basis = "gltf";           // its name, as in the API
  double metres_per_unit = 1;
  std::vector<Bone> skeleton;
  std::vector<std::uint32_t> bones;
  std::uint32_t encoding = 0, frame_bytes = 0;
  bool resumed = false;
  std::vector<Tier> tiers;  // from the inside out; one without rings
};

/// An agent as the stream introduces it. `rest_offsets`: x, y, z for each bone of the skeleton.
struct Agent {
  std::string id;
  std::uint32_t alias = 0;
  std::string name, body, gender = "female";
  std::vector<double> betas;
  std::uint64_t seed = 0;
  std::vector<float> rest_offsets;
};

/// The new frames of an agent; `poses` and `contacts` point into the message.
struct Chunk {
  std::uint32_t alias = 0;
  std::uint64_t seq = 0, first_frame = 0;
  double scheduled_at = 0;
  std::uint32_t goal_revision = 0;
  AgentState state = AgentState::unknown;
  std::uint32_t flags = 0, waypoint = 0, candidates = 0;
  std::size_t frames = 0;
  const std::uint8_t* poses = nullptr;     // as packed
  const std::uint8_t* contacts = nullptr;  // a byte per frame: 1 left foot, 2 right foot
};

struct Event {
  EventKind kind = EventKind::unknown;
  std::string agent_id;
  std::uint32_t alias = 0;
  double at = 0;
  std::uint32_t goal_revision = 0, waypoint = 0;
  std::string detail;
};

class ProtoReader;

/// Reads messages, and holds the last one. A batch that introduces no agent allocates nothing once the largest has
/// come.
class StreamDecoder {
 public:
  /// Read a message, whose bytes must stay in place while its chunks are read. Throws DecodeError.
  MessageKind decode(const std::uint8_t* message, std::size_t size);

  MessageKind kind() const { return kind_; }
  double sent_at() const { return sent_at_; }        // the server's clock
  const Header& header() const { return header_; }  // if it is a header
  const Event& event() const { return event_; }     // if it is an event
  /// If it is a batch: agents seen for the first time, and aliases of deleted ones.
  const std::vector<Agent>& added() const { return added_; }
  const std::vector<std::uint64_t>& removed() const { return removed_; }
  /// If it is a batch: aliases of agents that have left the last ring, and the tier of its chunks.
  const std::vector<std::uint64_t>& hidden() const { return hidden_; }
  std::size_t tier() const { return tier_; }
  /// If it is a batch: its chunks.
  std::size_t chunks() const { return columns_[ALIAS].size(); }
  Chunk chunk(std::size_t row) const;
  /// Resume token of the last batch that had one: everything up to it has come.
  const std::string& resume_token() const { return token_; }
  /// Throws DecodeError unless the chunks of the batch are whole frames of their tier.
  void check_frames(const Header& header) const;

 private:
  enum { ALIAS, SEQ, FIRST_FRAME, SCHEDULED_AT, GOAL_REVISION, STATE, FLAGS, WAYPOINT, CANDIDATES, COLUMNS };
  void batch(ProtoReader reader);
  void chunk_columns(ProtoReader reader);
  void check() const;

  MessageKind kind_ = MessageKind::none;
  double sent_at_ = 0;
  Header header_;
  Event event_;
  std::vector<Agent> added_;
  std::vector<std::uint64_t> removed_, hidden_;
  std::size_t tier_ = 0;
  std::array<std::vector<std::uint64_t>, COLUMNS> columns_;
  const std::uint8_t *poses_ = nullptr, *contacts_ = nullptr;
  std::size_t poses_size_ = 0, contacts_size_ = 0;
  std::string token_;
};

}  // namespace wayfarer
