// The agents of a stream, played smoothly: messages and times go in, poses come out.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "wayfarer/messages.hpp"
#include "wayfarer/playout.hpp"
#include "wayfarer/tiers.hpp"

namespace wayfarer {

/// An agent as it is shown.
struct PlayedAgent {
  PlayedAgent(const Agent& introduced, std::size_t width)
      : agent(introduced), frame(width), track(width) {}

  Agent agent;
  std::vector<float> frame;  // hips x, y, z, then x, y, z, w for each of the header's bones
  PoseTrack track;
  bool hidden = false;  // removed for having left the last ring; it may come again
  std::size_t tier = 0;  // number of its ring, from the last chunk
  bool shown = false;  // whether `frame` holds a pose
  AgentState state = AgentState::standing;  // from the last chunk
};

/// Callbacks of a player, called as messages come; `removed` is also called for agents that have left the last ring and
/// are `hidden`. A callback must not call the player.
struct PlayerEvents {
  std::function<void(const Header&, bool again)> header;
  std::function<void(PlayedAgent&)> added, removed;
  std::function<void(PlayedAgent&, const Chunk&)> chunk;
  std::function<void(const Event&)> event;
};

/// Counts since the start; `gaps`, `reduced` and `held` count chunks with that flag.
struct PlayerStats {
  std::uint64_t messages = 0, bytes = 0, chunks = 0, frames = 0, gaps = 0, reduced = 0, held = 0;
};

/// Plays a stream. Times are seconds of any clock of this machine. Allocates only for new agents.
/// One thread at a time.
class MotionPlayer {
 public:
  explicit MotionPlayer(PlayerEvents on = {}) : on_(std::move(on)) {}

  /// A connection begins: its first message is a header.
  void begin() { begun_ = false; }
  /// A message of the stream has come at local `now`. Throws DecodeError; the connection is then of no more use.
  MessageKind receive(const std::uint8_t* message, std::size_t size, double now);
  /// Show all agents as at local `now`. Returns the moment shown, in server time.
  double advance(double now);
  /// Forget all agents, as if they were removed, and the clock.
  void clear();
  /// Forget an agent.
  void remove(std::uint32_t alias);

  /// Agents by alias; their addresses stay until they are removed.
  const std::map<std::uint32_t, PlayedAgent>& agents() const { return agents_; }
  const std::optional<Header>& header() const { return header_; }
  PlayoutClock& clock() { return clock_; }
  /// The moment shown: server time, seconds since 1970. NaN before the first.
  double moment() const { return moment_; }
  const PlayerStats& stats() const { return stats_; }
  /// The token from which the next stream resumes; "" at first.
  const std::string& resume_token() const { return decoder_.resume_token(); }
  /// How often an agent's frames ran out.
  std::size_t underruns() const;
  /// Seconds of motion in the queue of the agent that has the least; infinity without agents.
  double buffered() const;

 private:
  void take_header();
  void take_batch(double now);
  void add(const Agent& agent, std::size_t width);
  void take_chunk(const Chunk& chunk, std::size_t width, double now);

  PlayerEvents on_;
  StreamDecoder decoder_;
  PlayoutClock clock_;
  std::map<std::uint32_t, PlayedAgent> agents_;
  std::optional<Header> header_;
  std::optional<TierUnpacker> tiers_;
  std::vector<float> unpacked_;
  PlayerStats stats_;
  std::size_t gone_underruns_ = 0;
  bool begun_ = false;
  double moment_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace wayfarer
