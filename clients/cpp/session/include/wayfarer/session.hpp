// A session of a server: made, streamed over WebSocket and played.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "wayfarer/api.hpp"
#include "wayfarer/core.hpp"

namespace wayfarer {

/// Callbacks of a stream: `status` "connecting", "open", "lost"; `ended(reason)` when another attempt is pointless.
struct StreamEvents {
  std::function<void(const std::string& status, const std::string& detail)> status;
  std::function<void(const std::string& reason)> ended;
};

/// Brings a session's motion to a player. A lost connection is restored and resumes where it was. Everything happens in
/// `poll`.
class MotionStream {
 public:
  /// `wish`: query of WS /v1/stream: {{"encoding", "smallest_three"}, {"fps", "20"}}.
  MotionStream(const Api& api, const std::string& session_id, const std::map<std::string, std::string>& wish,
               MotionPlayer& player, StreamEvents on = {});
  ~MotionStream();
  MotionStream(const MotionStream&) = delete;
  MotionStream& operator=(const MotionStream&) = delete;

  /// Request this from the next connection on.
  void wish(const std::string& key, const std::string& value);
  /// Send a text. Only the last within a tenth of a second is sent, and none twice.
  void say(const std::string& text);
  /// Do what is due, without waiting, at local `now`.
  void poll(double now);
  /// Close the stream.
  void close();

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

struct SessionOptions {
  std::string token;                         // an API key or JWT
  Json session = Json::object();             // body of POST /v1/sessions: basis, scene, lease_s and others
  std::map<std::string, std::string> wish;   // query of the stream
  Json interest;  // its levels of detail: {"rings": [{"radius": 15}, …], "viewpoints": [{"position": {"x": 0, …}}]}
  PlayerEvents on;
  StreamEvents stream;
};

/// People who walk, and their poses. One thread at a time.
class Session {
 public:
  /// A session of your own. It ends with this object, or with its lease after this program. Throws ApiError.
  static Session open(const std::string& server, SessionOptions options = {});
  /// Another program's session, to watch or to give goals in.
  static Session join(const std::string& server, const std::string& id, SessionOptions options = {});
  ~Session();
  Session(Session&&) = default;
  Session& operator=(Session&&) = delete;

  /// Receive new messages, and show all agents as at this moment. Call it once per picture.
  void update();
  /// See the agents from these viewpoints, in a session with `interest`: [{"position": {"x": 0, "y": 1.7, "z": 0}}].
  /// Call it as often as the camera moves: ten calls a second at most are sent, and always the last. Throws
  /// std::logic_error without `interest`.
  void look(const Json& viewpoints);
  /// All agents as shown, by alias.
  const std::map<std::uint32_t, PlayedAgent>& agents() const { return player_->agents(); }
  MotionPlayer& player() { return *player_; }
  const Api& api() const { return *api_; }
  const std::string& id() const { return id_; }
  Json create_agents(const Json& agents) const { return api_->create_agents(id_, agents); }

 private:
  Session(std::unique_ptr<Api> api, std::string id, bool own, SessionOptions options);

  std::unique_ptr<Api> api_;
  std::string id_;
  Json interest_;
  bool own_;
  std::unique_ptr<MotionPlayer> player_;
  std::unique_ptr<MotionStream> stream_;
};

}  // namespace wayfarer
