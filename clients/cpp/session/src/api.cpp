#include "wayfarer/api.hpp"

#include <boost/asio/use_future.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/version.hpp>
#include <chrono>
#include <thread>

#include "connection.hpp"

namespace wayfarer {
namespace {

namespace http = beast::http;
constexpr std::chrono::seconds ANSWER(10);
constexpr double PATIENCE = 15;  // seconds for which a call that is refused temporarily is repeated

/// Run all pending work, then return the result of one operation.
template <class Result>
Result wait(net::io_context& io, std::future<Result> result) {
  io.restart();
  io.run();
  return result.get();
}

template <class Stream>
http::response<http::string_body> exchange(net::io_context& io, Stream& stream,
                                           http::request<http::string_body>& request) {
  http::response_parser<http::string_body> parser;
  parser.body_limit(MOST_BYTES);
  beast::flat_buffer buffer;
  wait(io, http::async_write(stream, request, net::use_future));
  wait(io, http::async_read(stream, buffer, parser, net::use_future));
  return parser.release();
}

http::response<http::string_body> send(const Server& server, http::request<http::string_body>& request) {
  net::io_context io;
  net::ip::tcp::resolver resolver(io);
  const auto found = wait(io, resolver.async_resolve(server.host, server.port, net::use_future));
#ifdef WAYFARER_TLS
  if (server.tls) {
    Secure stream(io, trust());
    expect(stream, server.host);
    beast::get_lowest_layer(stream).expires_after(ANSWER);
    wait(io, beast::get_lowest_layer(stream).async_connect(found, net::use_future));
    wait(io, stream.async_handshake(net::ssl::stream_base::client, net::use_future));
    return exchange(io, stream, request);
  }
#endif
  Plain stream(io);
  stream.expires_after(ANSWER);
  wait(io, stream.async_connect(found, net::use_future));
  return exchange(io, stream, request);
}

/// The text of a problem document with its fields, or the bare status.
std::string said(const Json& problem, unsigned status) {
  if (!problem.is_object()) return "HTTP " + std::to_string(status);  // a proxy's page
  std::string fields;
  if (const auto errors = problem.find("errors"); errors != problem.end() && errors->is_array())
    for (const Json& error : *errors)
      fields += (fields.empty() ? "" : "; ") + error.value("field", "") + ": " + error.value("detail", "");
  if (!fields.empty()) return fields;
  return problem.value("detail", problem.value("title", "HTTP " + std::to_string(status)));
}

/// The id of the session or scene that an answer has created, or "".
std::string made(const Json& answer) {
  for (const char* key : {"session_id", "scene_id"})
    if (answer.is_object() && answer.contains(key) && answer.at(key).is_string()) return answer.at(key);
  return "";
}

/// Whether a call continues at another node.
bool goes_on(Route& route, const ApiError& error) {
  const auto found = error.problem.find("endpoint");
  if (found == error.problem.end() || !found->is_object()) return route.refused(error.status, "", 0);
  return route.refused(error.status, found->value("host", ""), found->value("http_port", 0));
}

std::string agent_path(const std::string& id) { return "/v1/agents/" + url_encoded(id); }

}  // namespace

std::string url_encoded(const std::string& text) {
  static const char DIGITS[] = "0123456789ABCDEF";
  std::string found;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '~';
    if (plain) found += c;
    else found += {'%', DIGITS[byte >> 4], DIGITS[byte & 15]};
  }
  return found;
}

Server::Server(const std::string& url) : tls(url.rfind("https://", 0) == 0) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument("\"" + url + "\" is no server's address: " + why);
  };
  if (!tls && url.rfind("http://", 0) != 0) refuse("it begins with http:// or https://");
#ifndef WAYFARER_TLS
  if (tls) refuse("this library was built without OpenSSL, and so without https");
#endif
  std::string rest = url.substr(tls ? 8 : 7);
  while (!rest.empty() && rest.back() == '/') rest.pop_back();
  if (rest.find_first_of("/?#@ ") != std::string::npos) refuse("it has only a host and a port");
  const std::size_t colon = rest.find(':', rest.find(']') == std::string::npos ? 0 : rest.find(']'));
  host = rest.substr(0, colon);
  port = colon == std::string::npos ? (tls ? "443" : "80") : rest.substr(colon + 1);
  if (host.size() > 1 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  if (host.empty()) refuse("it has no host");
  if (port.empty() || port.find_first_not_of("0123456789") != std::string::npos) refuse("its port is no number");
}

Api::Api(const std::string& server, std::string token)
    : server_(server),
      homes_(std::make_shared<Homes>(server.substr(0, server.find_last_not_of('/') + 1))),
      token_(std::move(token)) {}

Json Api::create_session(const Json& options) const { return call("POST", "/v1/sessions", options); }

void Api::delete_session(const std::string& session_id) const {
  call("DELETE", "/v1/sessions/" + url_encoded(session_id));
}

Json Api::create_agents(const std::string& session_id, const Json& agents) const {
  return call("POST", "/v1/sessions/" + url_encoded(session_id) + "/agents", {{"agents", agents}}).at("agents");
}

Json Api::fit_body(const BoneMap& map, const std::string& basis) const {
  const CharacterJoints found = character_joints(map, basis_named(basis));
  Json joints = Json::array();
  for (std::size_t b = 0; b < BONE_COUNT; ++b) {
    const Vec3& place = found.places[b];
    if (map.nodes()[b] >= 0)
      joints.push_back({{"bone", BONES[b]}, {"position", {{"x", place.x}, {"y", place.y}, {"z", place.z}}}});
  }
  Json wanted{{"joints", joints}, {"basis", basis}};
  if (found.floor == found.floor) wanted["floor"] = found.floor;
  return call("POST", "/v1/bodies:fit", wanted);
}

void Api::delete_agent(const std::string& agent_id) const { call("DELETE", agent_path(agent_id)); }

Json Api::set_goal(const std::string& agent_id, const Json& goal) const {
  return call("PUT", agent_path(agent_id) + "/goal", goal);
}

Json Api::set_path(const std::string& agent_id, const Json& goals) const {
  return call("PUT", agent_path(agent_id) + "/path", {{"goals", goals}});
}

Json Api::wander(const std::string& agent_id, const Json& how) const {
  return call("PUT", agent_path(agent_id) + "/wander", how);
}

Json Api::behave(const std::string& agent_id, const Json& behaviour) const {
  return call("PUT", agent_path(agent_id) + "/behaviour", behaviour);
}

void Api::clear_goal(const std::string& agent_id) const { call("DELETE", agent_path(agent_id) + "/goal"); }

Json Api::call(const std::string& method, const std::string& path, const Json& body) const {
  Route route(*homes_, path);
  for (double patience = PATIENCE;;) {
    try {
      Json answer = ask(route.address(), method, path, body);
      route.answered(made(answer));
      return answer;
    } catch (const ApiError& error) {
      if (goes_on(route, error)) continue;
      const double wait = error.status == 429 && error.problem.is_object() ? error.problem.value("retry_after_s", 0.0) : 0;
      if (wait <= 0 || wait > patience) throw;
      patience -= wait;
      std::this_thread::sleep_for(std::chrono::duration<double>(wait));
    }
  }
}

Json Api::ask(const std::string& address, const std::string& method, const std::string& path, const Json& body) const {
  const Server server(address);
  http::request<http::string_body> request{http::string_to_verb(method), path, 11};
  request.set(http::field::host, server.host + ":" + server.port);
  request.set(http::field::accept, "application/json");
  request.set(http::field::connection, "close");
  if (!token_.empty()) request.set(http::field::authorization, "Bearer " + token_);
  if (!body.is_null()) {
    request.set(http::field::content_type, "application/json");
    request.body() = body.dump();
  }
  request.prepare_payload();
  http::response<http::string_body> response;
  try {
    response = send(server, request);
  } catch (const boost::system::system_error& error) {
    throw ApiError("no answer from " + server.host + ":" + server.port + ": " + error.code().message(), 0);
  }
  const Json answer = response.body().empty() ? Json() : Json::parse(response.body(), nullptr, false);
  const unsigned status = response.result_int();
  if (status >= 300) throw ApiError(said(answer, status), static_cast<int>(status), answer);
  if (answer.is_discarded()) throw ApiError(method + " " + path + ": the answer is no JSON", static_cast<int>(status));
  return answer;
}

}  // namespace wayfarer
