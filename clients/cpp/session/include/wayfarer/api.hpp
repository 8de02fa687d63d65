// The HTTP API as calls. A server's /docs is its reference.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "wayfarer/homes.hpp"
#include "wayfarer/retarget.hpp"

namespace wayfarer {

using Json = nlohmann::json;

/// A call was refused, or had no answer (`status` 0). `problem`: the server's document (RFC 9457), or null.
struct ApiError : std::runtime_error {
  ApiError(const std::string& what, int http_status, Json document = nullptr)
      : std::runtime_error(what), status(http_status), problem(std::move(document)) {}
  int status;
  Json problem;
};

/// A server's address: "http://host:port" or "https://…".
struct Server {
  /// Throws std::invalid_argument; for https also if this library was built without OpenSSL.
  explicit Server(const std::string& url);
  std::string host, port;
  bool tls;
};

/// Calls of a server. Each blocks until it is answered, 10 s at most (and 15 s more while the server refuses it
/// temporarily). Each has its own connection: any thread may call, but not a game's frame loop. Throws ApiError.
/// Positions are in the session's basis and unit.
class Api {
 public:
  explicit Api(const std::string& server, std::string token = "");

  /// `options` as of POST /v1/sessions: {{"basis", "unreal"}, {"scene", "scene-1"}, …}
  Json create_session(const Json& options = Json::object()) const;
  void delete_session(const std::string& session_id) const;
  /// [{{"name", "Ada"}, {"gender", "female"}, {"position", {{"x", 1}, …}}}, …]. Returns the agents.
  Json create_agents(const std::string& session_id, const Json& agents) const;
  /// The body whose bones are as long as a character's: an agent with its "gender" and "betas" takes steps that fit the
  /// character's legs. "scale" and "lengths" say how close it is (docs/api.md, "Agents").
  Json fit_body(const BoneMap& map, const std::string& basis = "gltf") const;
  void delete_agent(const std::string& agent_id) const;
  /// Goals: {{"position", {{"x", 2}, {"y", 0}, {"z", 3}}}, {"speed", 1.2}, {"heading", 0}, …}. docs/api.md, "Goals".
  Json set_goal(const std::string& agent_id, const Json& goal) const;
  Json set_path(const std::string& agent_id, const Json& goals) const;
  Json wander(const std::string& agent_id, const Json& how = Json::object()) const;
  Json behave(const std::string& agent_id, const Json& behaviour) const;
  void clear_goal(const std::string& agent_id) const;
  /// Any other call: call("GET", "/v1/bodies").
  Json call(const std::string& method, const std::string& path, const Json& body = nullptr) const;

  const Server& server() const { return server_; }
  /// The known nodes of a cluster.
  Homes& homes() const { return *homes_; }
  const std::string& token() const { return token_; }

 private:
  Json ask(const std::string& address, const std::string& method, const std::string& path, const Json& body) const;

  Server server_;
  std::shared_ptr<Homes> homes_;
  std::string token_;
};

/// Text as a part of a path or query.
std::string url_encoded(const std::string& text);

}  // namespace wayfarer
