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

  /// The address at which the one whose id is in `about` is called.
  std::string home(const std::string& about) const;
  /// A node's address, by the entry's scheme. `host`: "" is the entry's.
  std::string node(const std::string& host, int port) const;
  /// They live there.
  void learn(const std::string& about, const std::string& address);
  /// Nobody knows where they live, but the entry.
  void forget(const std::string& about);
  const std::string& entry() const { return entry_; }

 private:
  std::string entry_;
  mutable std::mutex gate_;
  std::map<std::string, std::string> homes_;  // addresses by slot
};

/// The addresses that a call, or a stream, goes to in turn: `address` is the next one. At most four: the node that is
/// known, the one that it names, the entry, the one that it names.
class Route {
 public:
  /// `about`: text with the id of whom the call concerns; "": nobody's.
  Route(Homes& homes, std::string about);

  const std::string& address() const { return address_; }
  /// Start again: as for a new call.
  void begin();
  /// The call has succeeded, or the stream has begun. `made`: id of what was made by it.
  void answered(const std::string& made = "");
  /// `address` has named another node; whether the call goes on, to the new `address`. Port 0, or what is no host's
  /// name: it has named none.
  bool misdirected(const std::string& host, int port);
  /// `address` does not answer, or not at present; as `misdirected`.
  bool unavailable();
  /// A call was refused, by an HTTP status (0: no answer) and the problem's `endpoint`; whether it goes on.
  bool refused(int status, const std::string& host, int port);
  /// A stream has ended, with this code and reason; whether to connect to `address` at once.
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
