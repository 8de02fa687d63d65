// A session of a server: made, streamed over WebSocket and played.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "wayfarer/api.hpp"
#include "wayfarer/core.hpp"

namespace wayfarer {

/// What a stream tells: `status`: "connecting", "open", "lost"; `ended(reason)`: there is no sense in trying again.
struct StreamEvents {
  std::function<void(const std::string& status, const std::string& detail)> status;
  std::function<void(const std::string& reason)> ended;
};

/// Brings a session's motion to a player. A lost connection is made again and goes on where it was. Nothing happens but
/// in `poll`.
class MotionStream {
 public:
  /// `wish`: query of WS /v1/stream: {{"encoding", "smallest_three"}, {"fps", "20"}}.
  MotionStream(const Api& api, const std::string& session_id, const std::map<std::string, std::string>& wish,
               MotionPlayer& player, StreamEvents on = {});
  ~MotionStream();
  MotionStream(const MotionStream&) = delete;
  MotionStream& operator=(const MotionStream&) = delete;

  /// Ask for this from the next connection on.
  void wish(const std::string& key, const std::string& value);
  /// Send a text: the last of those within a tenth of a second, and none twice.
  void say(const std::string& text);
  /// Do what is due, without waiting, at local `now`.
  void poll(double now);
  /// Leave it for good.
  void close();

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

struct SessionOptions {
  std::string token;                         // an API key or JWT
  Json session = Json::object();             // of POST /v1/sessions: basis, scene, lease_s …
  std::map<std::string, std::string> wish;   // of the stream
  Json interest;  // its levels of detail: {"rings": [{"radius": 15}, …], "viewpoints": [{"position": {"x": 0, …}}]}
  PlayerEvents on;
  StreamEvents stream;
};

/// People who walk, and where they are. One thread at a time.
class Session {
 public:
  /// A session of your own. It ends when this object does, or with its lease after this program. Throws ApiError.
  static Session open(const std::string& server, SessionOptions options = {});
  /// Somebody else's, to watch or to give goals in.
  static Session join(const std::string& server, const std::string& id, SessionOptions options = {});
  ~Session();
  Session(Session&&) = default;
  Session& operator=(Session&&) = delete;

  /// Once per picture: receive what has come, and show everybody as at this moment.
  void update();
  /// See the agents from these viewpoints, of a session with `interest`: [{"position": {"x": 0, "y": 1.7, "z": 0}}]. Call it as
  /// often as the camera moves: ten a second are sent at most, and the last always. Throws std::logic_error without.
  void look(const Json& viewpoints);
  /// Everybody, as shown, by alias.
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
