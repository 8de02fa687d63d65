// Where a call goes when a server is many nodes: the rule of clients/README.md, "Many nodes".
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace wayfarer {

class Route;

/// The nodes at which sessions, scenes and agents live, as far as is known. Any thread may call.
class Homes {
 public:
  /// `entry`: the server's address, "http://host:port" or "host:port".
  explicit Homes(std::string entry) : entry_(std::move(entry)) {}

  /// The address for calls about the id in `about`.
  std::string home(const std::string& about) const;
  /// A node's address, by the entry's scheme. `host`: "" is the entry's.
  std::string node(const std::string& host, int port) const;
  /// Note that the slot of `about` lives at `address`.
  void learn(const std::string& about, const std::string& address);
  /// Forget where it lives; only the entry knows.
  void forget(const std::string& about);
  const std::string& entry() const { return entry_; }

 private:
  std::string entry_;
  mutable std::mutex gate_;
  std::map<std::string, std::string> homes_;  // addresses by slot
};

/// The addresses to which a call or a stream goes in turn: `address` is the next one. At most four: the known node, the
/// node it names, the entry, and the node that the entry names.
class Route {
 public:
  /// `about`: text with the id that the call concerns; "": none.
  Route(Homes& homes, std::string about);

  const std::string& address() const { return address_; }
  /// Start again, as for a new call.
  void begin();
  /// The call has succeeded, or the stream has begun. `made`: id of what was made by it.
  void answered(const std::string& made = "");
  /// Note that `address` has named another node; returns whether the call continues there. Port 0, or an invalid host
  /// name: it has named none.
  bool misdirected(const std::string& host, int port);
  /// Note that `address` does not answer at present; returns as `misdirected`.
  bool unavailable();
  /// Note a refusal, by an HTTP status (0: no answer) and the problem's `endpoint`. Returns whether the call continues.
  bool refused(int status, const std::string& host, int port);
  /// Note the end of a stream, with code and reason; returns whether to connect to `address` at once.
  bool closed(int code, const std::string& reason);

 private:
  bool ask();

  Homes* homes_;
  std::string about_, address_;
  bool asked_ = false, followed_ = false;
};

/// Host and port that the close reason of a stream names (code 4421); port 0: none.
std::pair<std::string, int> place_of(const std::string& reason);

}  // namespace wayfarer
