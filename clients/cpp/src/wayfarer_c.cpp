#include "wayfarer/wayfarer.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "wayfarer/core.hpp"

using namespace wayfarer;

struct wf_player {
  std::unique_ptr<MotionPlayer> player;
  wf_agent_callback added = nullptr, removed = nullptr;
  wf_chunk_callback chunk = nullptr;
  wf_event_callback event = nullptr;
  void *added_user = nullptr, *removed_user = nullptr, *chunk_user = nullptr, *event_user = nullptr;
};

struct wf_rig {
  std::vector<Node> nodes;
  std::map<std::string, int> humanoid;
  wayfarer::BoneMap::Changes corrections;
};

struct wf_map {
  BoneMap map;
  std::optional<Soles> soles{};
};

struct wf_retarget {
  Retarget retarget;
};

struct wf_root {
  SmoothRoot root;
};

struct wf_homes {
  std::shared_ptr<Homes> homes;
};

struct wf_route {
  std::shared_ptr<Homes> homes;
  Route route;
};

namespace {

std::string& last_error() {
  thread_local std::string said;
  return said;
}

/// The result of `make`, or `failed`: no exception leaves the library.
template <class Result, class Make>
Result guarded(Result failed, Make make) noexcept {
  try {
    return make();
  } catch (const std::exception& error) {
    try {
      last_error() = error.what();
    } catch (...) {  // no memory for the message
    }
    return failed;
  }
}

const PlayedAgent* find(const wf_player* handle, std::uint32_t alias) {
  const auto found = handle->player->agents().find(alias);
  return found == handle->player->agents().end() ? nullptr : &found->second;
}

void put(const Quat& q, double* out) { out[0] = q.x, out[1] = q.y, out[2] = q.z, out[3] = q.w; }
void put(const Vec3& v, double* out) { out[0] = v.x, out[1] = v.y, out[2] = v.z; }

}  // namespace

const char* wf_error() { return last_error().c_str(); }
const char* wf_version() { return "0.2.0"; }

const char* wf_bone_name(std::int32_t bone) {
  return bone >= 0 && bone < BONE_COUNT ? BONES[static_cast<std::size_t>(bone)].data() : nullptr;
}

std::int32_t wf_bone_number(const char* name) { return bone_number(name); }

wf_player* wf_player_create() {
  return guarded<wf_player*>(nullptr, [] {
    auto handle = std::make_unique<wf_player>();
    wf_player* own = handle.get();
    PlayerEvents on;
    on.added = [own](PlayedAgent& played) {
      if (own->added) own->added(own->added_user, played.agent.alias);
    };
    on.removed = [own](PlayedAgent& played) {
      if (own->removed) own->removed(own->removed_user, played.agent.alias);
    };
    on.chunk = [own](PlayedAgent&, const Chunk& chunk) {
      if (own->chunk) own->chunk(own->chunk_user, chunk.alias, chunk.flags, chunk.goal_revision, chunk.waypoint);
    };
    on.event = [own](const Event& event) {
      if (own->event)
        own->event(own->event_user, name_of(event.kind).data(), event.agent_id.c_str(), event.at,
                   event.goal_revision, event.waypoint, event.detail.c_str());
    };
    handle->player = std::make_unique<MotionPlayer>(std::move(on));
    return handle.release();
  });
}

void wf_player_destroy(wf_player* player) { delete player; }
void wf_player_begin(wf_player* player) { player->player->begin(); }

std::int32_t wf_player_receive(wf_player* player, const std::uint8_t* message, std::size_t size, double now) {
  return guarded<std::int32_t>(
      WF_ERROR, [&] { return static_cast<std::int32_t>(player->player->receive(message, size, now)); });
}

double wf_player_advance(wf_player* player, double now) { return player->player->advance(now); }
void wf_player_clear(wf_player* player) { player->player->clear(); }
const char* wf_player_resume_token(const wf_player* player) { return player->player->resume_token().c_str(); }

const char* wf_player_basis(const wf_player* player) {
  const auto& header = player->player->header();
  return header ? header->basis.c_str() : "";
}

double wf_player_metres_per_unit(const wf_player* player) {
  const auto& header = player->player->header();
  return header ? header->metres_per_unit : 1;
}

double wf_player_delay(wf_player* player, double now) { return player->player->clock().delay(now); }
double wf_player_buffered(const wf_player* player) { return player->player->buffered(); }

std::uint64_t wf_player_count(const wf_player* player, const char* what) {
  const PlayerStats& stats = player->player->stats();
  const std::pair<const char*, std::uint64_t> counts[]{
      {"messages", stats.messages}, {"bytes", stats.bytes}, {"chunks", stats.chunks},
      {"frames", stats.frames},     {"gaps", stats.gaps},   {"reduced", stats.reduced},
      {"held", stats.held},         {"underruns", player->player->underruns()}};
  for (const auto& [name, count] : counts)
    if (std::strcmp(name, what) == 0) return count;
  return 0;
}

void wf_player_on_added(wf_player* player, wf_agent_callback call, void* user) {
  player->added = call, player->added_user = user;
}

void wf_player_on_removed(wf_player* player, wf_agent_callback call, void* user) {
  player->removed = call, player->removed_user = user;
}

void wf_player_on_chunk(wf_player* player, wf_chunk_callback call, void* user) {
  player->chunk = call, player->chunk_user = user;
}

void wf_player_on_event(wf_player* player, wf_event_callback call, void* user) {
  player->event = call, player->event_user = user;
}

std::size_t wf_player_agents(const wf_player* player, std::uint32_t* aliases, std::size_t room) {
  const auto& agents = player->player->agents();
  auto found = agents.begin();
  for (std::size_t k = 0; k < room && found != agents.end(); ++k, ++found) aliases[k] = found->first;
  return agents.size();
}

const char* wf_agent_id(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? played->agent.id.c_str() : nullptr;
}

const char* wf_agent_name(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? played->agent.name.c_str() : nullptr;
}

const float* wf_agent_rest_offsets(const wf_player* player, std::uint32_t alias, std::size_t* count) {
  const PlayedAgent* played = find(player, alias);
  if (count) *count = played ? played->agent.rest_offsets.size() : 0;
  return played ? played->agent.rest_offsets.data() : nullptr;
}

const float* wf_agent_frame(const wf_player* player, std::uint32_t alias, std::size_t* count) {
  const PlayedAgent* played = find(player, alias);
  const bool shown = played && played->shown;
  if (count) *count = shown ? played->frame.size() : 0;
  return shown ? played->frame.data() : nullptr;
}

std::int32_t wf_agent_state(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? static_cast<std::int32_t>(played->state) : WF_ERROR;
}

std::int32_t wf_agent_tier(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? static_cast<std::int32_t>(played->tier) : WF_ERROR;
}

std::int32_t wf_agent_contacts(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? played->track.contacts() : WF_ERROR;
}

std::int32_t wf_agent_held(const wf_player* player, std::uint32_t alias) {
  const PlayedAgent* played = find(player, alias);
  return played ? played->track.held() : WF_ERROR;
}

wf_rig* wf_rig_create() {
  return guarded<wf_rig*>(nullptr, [] { return new wf_rig; });
}

void wf_rig_destroy(wf_rig* rig) { delete rig; }

std::int32_t wf_rig_add(wf_rig* rig, const char* name, std::int32_t parent, const double position[3],
                        const double rotation[4], const double scale[3]) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    const auto number = static_cast<std::int32_t>(rig->nodes.size());
    if (parent < -1 || parent >= number)
      throw std::invalid_argument("node " + std::to_string(number) + " (" + name +
                                  "): its parent must stand before it");
    rig->nodes.push_back({name, parent, {position[0], position[1], position[2]},
                          {rotation[0], rotation[1], rotation[2], rotation[3]}, {scale[0], scale[1], scale[2]}});
    return number;
  });
}

std::int32_t wf_rig_humanoid(wf_rig* rig, const char* vrm_name, std::int32_t node) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    if (node < 0 || static_cast<std::size_t>(node) >= rig->nodes.size())
      throw std::invalid_argument(std::string(vrm_name) + ": the rig has no node " + std::to_string(node));
    rig->humanoid[vrm_name] = node;
    return 0;
  });
}

std::int32_t wf_rig_correct(wf_rig* rig, const char* bone, const char* node_name) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    rig->corrections[bone] = node_name ? std::optional<std::string>(node_name) : std::nullopt;
    return 0;
  });
}

wf_map* wf_map_create(const wf_rig* rig, const char* basis) {
  return guarded<wf_map*>(nullptr, [&] {
    return new wf_map{map_bones(Rig(rig->nodes), rig->humanoid, basis_named(basis), rig->corrections)};
  });
}

void wf_map_destroy(wf_map* map) { delete map; }
const char* wf_map_found_by(const wf_map* map) { return map->map.found_by().c_str(); }

std::int32_t wf_map_node(const wf_map* map, std::int32_t bone) {
  return bone >= 0 && bone < BONE_COUNT ? map->map.nodes()[static_cast<std::size_t>(bone)] : -1;
}

std::int32_t wf_map_correct(wf_map* map, const char* bone, const char* node_name) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    const auto node = node_name ? std::optional<std::string>(node_name) : std::nullopt;
    map->map = map->map.corrected({{bone, node}});
    map->soles.reset();  // they were measured for other bones
    return 0;
  });
}

std::int32_t wf_map_soles(wf_map* map, const char* basis, const double* places, const std::int32_t* nodes,
                          std::size_t count) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    std::vector<Vec3> found(count);
    for (std::size_t k = 0; k < count; ++k) found[k] = {places[3 * k], places[3 * k + 1], places[3 * k + 2]};
    map->soles = measure_soles(map->map, found, {nodes, nodes + count}, basis_named(basis));
    return map->soles ? 1 : 0;
  });
}

std::int32_t wf_map_joints(const wf_map* map, const char* basis, double* places, double* floor) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    const CharacterJoints joints = character_joints(map->map, basis_named(basis), map->soles ? &*map->soles : nullptr);
    for (const Vec3& place : joints.places) put(place, places), places += 3;
    *floor = joints.floor;
    return 0;
  });
}

wf_retarget* wf_retarget_create(const wf_map* map, const float* rest_offsets, std::size_t count, const char* basis,
                                double floor) {
  return guarded<wf_retarget*>(nullptr, [&] {
    const std::vector<float> offsets(rest_offsets, rest_offsets + count);
    return new wf_retarget{Retarget(map->map, offsets, basis_named(basis), floor, map->soles ? &*map->soles : nullptr)};
  });
}

void wf_retarget_destroy(wf_retarget* retarget) { delete retarget; }

std::int32_t wf_retarget_pose(wf_retarget* retarget, const float* frame, std::size_t count, double ground) {
  return guarded<std::int32_t>(WF_ERROR, [&] {
    if (count < frame_width(BONE_COUNT))
      throw std::invalid_argument("a frame of the profile body or full is needed, with 91 numbers or more");
    retarget->retarget.pose(frame, ground);
    return 0;
  });
}

void wf_retarget_local(const wf_retarget* retarget, double* rotations) {
  for (const int b : retarget->retarget.mapped()) put(retarget->retarget.local(b), rotations + 4 * b);
}

void wf_retarget_world(const wf_retarget* retarget, double* rotations, double* places) {
  for (const int b : retarget->retarget.mapped()) {
    put(retarget->retarget.rotation(b), rotations + 4 * b);
    put(retarget->retarget.place(b), places + 3 * b);
  }
}

std::int32_t wf_retarget_moved(const wf_retarget* retarget, std::int32_t bone, double place[3]) {
  const std::vector<int>& loose = retarget->retarget.loose();
  if (std::find(loose.begin(), loose.end(), bone) == loose.end()) return 0;
  put(retarget->retarget.moved(bone), place);
  return 1;
}

void wf_retarget_hips(const wf_retarget* retarget, double place[3]) { put(retarget->retarget.hips(), place); }
double wf_retarget_ratio(const wf_retarget* retarget) { return retarget->retarget.ratio(); }
double wf_retarget_ground(const wf_retarget* retarget) { return retarget->retarget.ground(); }

wf_root* wf_root_create(const char* basis, double metres_per_unit) {
  return guarded<wf_root*>(nullptr, [&] { return new wf_root{SmoothRoot(basis_named(basis), metres_per_unit)}; });
}

void wf_root_destroy(wf_root* root) { delete root; }

void wf_root_update(wf_root* root, double time, const float* frame, double ground, double point[3],
                    double* heading) {
  root->root.update(time, frame, ground);
  put(root->root.point(), point);
  *heading = root->root.heading();
}

wf_homes* wf_homes_create(const char* entry) {
  return guarded<wf_homes*>(nullptr, [&] { return new wf_homes{std::make_shared<Homes>(entry)}; });
}

void wf_homes_destroy(wf_homes* homes) { delete homes; }

wf_route* wf_route_create(wf_homes* homes, const char* about) {
  return guarded<wf_route*>(nullptr, [&] { return new wf_route{homes->homes, Route(*homes->homes, about)}; });
}

void wf_route_destroy(wf_route* route) { delete route; }

const char* wf_route_address(const wf_route* route) { return route->route.address().c_str(); }

void wf_route_begin(wf_route* route) {
  guarded<int>(0, [&] { return route->route.begin(), 0; });
}

void wf_route_answered(wf_route* route, const char* made) {
  guarded<int>(0, [&] { return route->route.answered(made), 0; });
}

std::int32_t wf_route_refused(wf_route* route, std::int32_t status, const char* host, std::int32_t port) {
  return guarded<std::int32_t>(0, [&] { return route->route.refused(status, host, port) ? 1 : 0; });
}

std::int32_t wf_route_closed(wf_route* route, std::int32_t code, const char* reason) {
  return guarded<std::int32_t>(0, [&] { return route->route.closed(code, reason) ? 1 : 0; });
}
