#include "wayfarer/homes.hpp"

#include <algorithm>
#include <cstddef>

namespace wayfarer {
namespace {

/// The slot of the first id in a text, which a session and its agents share; "" without one.
std::string slot_of(const std::string& about) {
  constexpr std::size_t DIGITS = 4;
  std::string found;
  std::size_t first = std::string::npos;
  for (const std::string kind : {"session-", "scene-", "agent-"}) {
    for (std::size_t at = about.find(kind); at < first; at = about.find(kind, at + 1)) {
      const std::string slot = about.substr(at + kind.size(), DIGITS);
      if (slot.size() < DIGITS || slot.find_first_not_of("0123456789abcdef") != std::string::npos) continue;
      first = at;
      found = slot;
    }
  }
  return found;
}

bool is_place(const std::string& host, int port) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string("_.:[]-").find(c) != std::string::npos;
  };
  return port > 0 && port < 1 << 16 && std::all_of(host.begin(), host.end(), allowed);
}

}  // namespace

std::string Homes::home(const std::string& about) const {
  const std::lock_guard<std::mutex> lock(gate_);
  const auto found = homes_.find(slot_of(about));
  return found == homes_.end() ? entry_ : found->second;
}

std::string Homes::node(const std::string& host, int port) const {
  std::size_t begin = 0;
  for (const std::string scheme : {"http://", "https://"})
    if (entry_.rfind(scheme, 0) == 0) begin = scheme.size();
  std::string name = host.find(':') != std::string::npos && host[0] != '[' ? "[" + host + "]" : host;  // IPv6
  if (name.empty()) {
    const std::size_t bracket = entry_[begin] == '[' ? entry_.find(']', begin) : std::string::npos;
    const std::size_t end = bracket == std::string::npos ? entry_.find(':', begin) : bracket + 1;
    name = entry_.substr(begin, end == std::string::npos ? end : end - begin);
  }
  return entry_.substr(0, begin) + name + ":" + std::to_string(port);
}

void Homes::learn(const std::string& about, const std::string& address) {
  const std::string slot = slot_of(about);
  const std::lock_guard<std::mutex> lock(gate_);
  if (!slot.empty()) homes_[slot] = address;
}

void Homes::forget(const std::string& about) {
  const std::lock_guard<std::mutex> lock(gate_);
  homes_.erase(slot_of(about));
}

Route::Route(Homes& homes, std::string about) : homes_(&homes), about_(std::move(about)) { begin(); }

void Route::begin() {
  address_ = homes_->home(about_);
  asked_ = address_ == homes_->entry();
  followed_ = false;
}

void Route::answered(const std::string& made) {
  if (address_ != homes_->entry()) homes_->learn(slot_of(made).empty() ? about_ : made, address_);
  begin();
}

bool Route::misdirected(const std::string& host, int port) {
  if (followed_ || !is_place(host, port)) return ask();
  followed_ = true;
  address_ = homes_->node(host, port);
  homes_->learn(about_, address_);
  return true;
}

bool Route::unavailable() { return ask(); }

bool Route::refused(int status, const std::string& host, int port) {
  if (status == 421) return misdirected(host, port);
  return (status == 0 || status == 503) && unavailable();
}

bool Route::closed(int code, const std::string& reason) {
  const auto [host, port] = place_of(reason);
  if (code == 4421) return misdirected(host, port);
  unavailable();  // its node may have left the cluster; in any case not at once
  return false;
}

bool Route::ask() {
  homes_->forget(about_);
  if (asked_) return false;
  asked_ = true;
  followed_ = false;
  address_ = homes_->entry();
  return true;
}

std::pair<std::string, int> place_of(const std::string& reason) {
  const std::string begin = "call ";
  const std::size_t colon = reason.rfind(':');
  if (reason.rfind(begin, 0) != 0 || colon == std::string::npos) return {"", 0};
  const std::string port = reason.substr(colon + 1);
  if (port.empty() || port.size() > 5 || port.find_first_not_of("0123456789") != std::string::npos) return {"", 0};
  return {reason.substr(begin.size(), colon - begin.size()), std::stoi(port)};
}

}  // namespace wayfarer
