/* The core for C and for engine plug-ins: opaque handles, pointers and scalars; no structs, no exceptions.

   A handle is used by one thread at a time; different handles by any. Who creates a handle destroys it, once; NULL is
   fine. What fails returns NULL, or WF_ERROR; wf_error() then says why. Strings are UTF-8, and those that are returned
   stay until the handle, or the agent, is gone. Arrays are the caller's. Times are seconds. Quaternions are x, y, z, w. */
#ifndef WAYFARER_WAYFARER_H
#define WAYFARER_WAYFARER_H

#include <stddef.h>
#include <stdint.h>

#ifndef WF_API
#define WF_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define WF_BONES 22 /* bones of a pose; wf_bone_name gives their names */
#define WF_ERROR (-1)

/* Why the last call of this thread failed. */
WF_API const char *wf_error(void);
/* "0.2.0" */
WF_API const char *wf_version(void);
/* NULL when there is none of that number; -1 when there is none of that name. */
WF_API const char *wf_bone_name(int32_t bone);
WF_API int32_t wf_bone_number(const char *name);

/* ---- player: messages of WS /v1/stream go in, poses come out */

typedef struct wf_player wf_player;

enum { WF_NONE, WF_HEADER, WF_BATCH, WF_HEARTBEAT, WF_EVENT };        /* kinds of messages */
enum { WF_UNKNOWN, WF_STANDING, WF_WALKING, WF_STOPPING, WF_TURNING }; /* states of an agent */
enum { WF_FIRST = 1, WF_REPLANNED = 2, WF_ARRIVED = 4, WF_GAP = 8, WF_REDUCED = 16, WF_HELD = 32 }; /* flags */

WF_API wf_player *wf_player_create(void);
WF_API void wf_player_destroy(wf_player *player);
/* A connection begins: its first message is a header. */
WF_API void wf_player_begin(wf_player *player);
/* A binary frame has come at local `now`. Its kind, or WF_ERROR: close the connection then. */
WF_API int32_t wf_player_receive(wf_player *player, const uint8_t *message, size_t size, double now);
/* Show everybody as at local `now`. Returns the moment shown: the server's clock, seconds since 1970. */
WF_API double wf_player_advance(wf_player *player, double now);
/* Forget everybody, as if they were removed. */
WF_API void wf_player_clear(wf_player *player);
/* What to ask the next stream to go on from (?resume_token=); "" at first. Stays until the next message. */
WF_API const char *wf_player_resume_token(const wf_player *player);
/* The stream's basis, as in the API; "" before the header. */
WF_API const char *wf_player_basis(const wf_player *player);
WF_API double wf_player_metres_per_unit(const wf_player *player);
/* Seconds between a frame's time and its picture; seconds in hand of the agent that has the least. */
WF_API double wf_player_delay(wf_player *player, double now);
WF_API double wf_player_buffered(const wf_player *player);
/* Counted since the start: "messages", "bytes", "chunks", "frames", "gaps", "reduced", "held", "underruns"; any other
   name: 0. */
WF_API uint64_t wf_player_count(const wf_player *player, const char *what);

/* What happens while wf_player_receive runs. A callback must not call the player but for wf_agent_…. */
typedef void (*wf_agent_callback)(void *user, uint32_t alias);
typedef void (*wf_chunk_callback)(void *user, uint32_t alias, uint32_t flags, uint32_t goal_revision,
                                  uint32_t waypoint);
/* `kind` and `detail` in words: "path_done"; `agent_id` is "" for events of the stream or the server. */
typedef void (*wf_event_callback)(void *user, const char *kind, const char *agent_id, double at,
                                  uint32_t goal_revision, uint32_t waypoint, const char *detail);
WF_API void wf_player_on_added(wf_player *player, wf_agent_callback call, void *user);
WF_API void wf_player_on_removed(wf_player *player, wf_agent_callback call, void *user);
WF_API void wf_player_on_chunk(wf_player *player, wf_chunk_callback call, void *user);
WF_API void wf_player_on_event(wf_player *player, wf_event_callback call, void *user);

/* Aliases of the agents, at most `room` of them; returns how many there are. */
WF_API size_t wf_player_agents(const wf_player *player, uint32_t *aliases, size_t room);
/* Of an agent; NULL, 0, WF_ERROR when it is not known. */
WF_API const char *wf_agent_id(const wf_player *player, uint32_t alias);
WF_API const char *wf_agent_name(const wf_player *player, uint32_t alias);
WF_API const float *wf_agent_rest_offsets(const wf_player *player, uint32_t alias, size_t *count);
/* The pose at the moment shown: hips x, y, z, then x, y, z, w per bone; NULL before the first. `count`: numbers. */
WF_API const float *wf_agent_frame(const wf_player *player, uint32_t alias, size_t *count);
WF_API int32_t wf_agent_state(const wf_player *player, uint32_t alias);
/* Number of the ring that it is in, of a stream with levels of detail: 0 is the nearest. One that has left the last ring is
   removed, and added when it comes again. */
WF_API int32_t wf_agent_tier(const wf_player *player, uint32_t alias);
/* 1 left foot, 2 right foot on the ground; whether frames have run out, and the last one is held. */
WF_API int32_t wf_agent_contacts(const wf_player *player, uint32_t alias);
WF_API int32_t wf_agent_held(const wf_player *player, uint32_t alias);

/* ---- a character: its nodes at rest, which of them are which bones, and poses on it */

typedef struct wf_rig wf_rig;
typedef struct wf_map wf_map;
typedef struct wf_retarget wf_retarget;

WF_API wf_rig *wf_rig_create(void);
WF_API void wf_rig_destroy(wf_rig *rig);
/* Add a node, its parent before it (-1: none), with its rest transform relative to the parent. Returns its number. */
WF_API int32_t wf_rig_add(wf_rig *rig, const char *name, int32_t parent, const double position[3],
                          const double rotation[4], const double scale[3]);
/* That VRM's table calls a node so. */
WF_API int32_t wf_rig_humanoid(wf_rig *rig, const char *vrm_name, int32_t node);

/* Say which node a bone is (node_name NULL: none), before wf_map_create, which refuses a rig whose hips or legs it cannot
   find. */
WF_API int32_t wf_rig_correct(wf_rig *rig, const char *bone, const char *node_name);

/* Find the bones; `basis`: of the rig's space, as in the API ("gltf", "unreal_mannequin" …). */
WF_API wf_map *wf_map_create(const wf_rig *rig, const char *basis);
WF_API void wf_map_destroy(wf_map *map);
/* "vrm", "names", "shape", "user" */
WF_API const char *wf_map_found_by(const wf_map *map);
/* Node of a bone; -1: the rig lacks it. */
WF_API int32_t wf_map_node(const wf_map *map, int32_t bone);
/* Say which node a bone is (NULL: none). 0, or WF_ERROR with the map as before. */
WF_API int32_t wf_map_correct(wf_map *map, const char *bone, const char *node_name);

/* What the mesh at rest tells of the soles: vertices [count][3] in the rig's space, and the node that moves each most. All
   that is made of the map afterwards counts with them. 1; 0: a foot has no vertices; or WF_ERROR. */
WF_API int32_t wf_map_soles(wf_map *map, const char *basis, const double *places, const int32_t *nodes, size_t count);

/* Places [22][3] of the joints at rest, upright in the basis (of the rig's handedness), and the height of the floor (NAN:
   not known): what POST /v1/bodies:fit asks for, to make an agent with the character's proportions. */
WF_API int32_t wf_map_joints(const wf_map *map, const char *basis, double *places, double *floor);

/* `rest_offsets` of the agent; `floor`: height of the character's soles at rest (NAN: find it); all in the basis and
   unit of the stream, as is the rig. */
WF_API wf_retarget *wf_retarget_create(const wf_map *map, const float *rest_offsets, size_t count,
                                       const char *basis, double floor);
WF_API void wf_retarget_destroy(wf_retarget *retarget);
/* A frame of the agent (wf_agent_frame) on the character. `ground`: height of the ground there (NAN: that of the lower
   sole). 0, or WF_ERROR when the frame has fewer than the 22 bones. */
WF_API int32_t wf_retarget_pose(wf_retarget *retarget, const float *frame, size_t count, double ground);
/* Of the last pose, for the 22 bones (those that the rig lacks are left out, wf_map_node says which): rotations relative
   to the nodes' parents, [22][4]; the same in the world; places in the world, [22][3]. */
WF_API void wf_retarget_local(const wf_retarget *retarget, double *rotations);
WF_API void wf_retarget_world(const wf_retarget *retarget, double *rotations, double *places);
/* Place of a bone's node relative to its parent: 1 where it is to be set, as of the hips and of bones that hang from
   another bone than they follow; 0 where it stays. */
WF_API int32_t wf_retarget_moved(const wf_retarget *retarget, int32_t bone, double place[3]);
/* The same of the hips. */
WF_API void wf_retarget_hips(const wf_retarget *retarget, double place[3]);
/* Height of the character's thigh joints by that of the agent's. */
WF_API double wf_retarget_ratio(const wf_retarget *retarget);
/* Height of the ground of the last pose: that which was given, or of the lower sole. */
WF_API double wf_retarget_ground(const wf_retarget *retarget);

/* ---- a smooth root, for capsules, cameras and root motion */

typedef struct wf_root wf_root;

WF_API wf_root *wf_root_create(const char *basis, double metres_per_unit);
WF_API void wf_root_destroy(wf_root *root);
/* At `time` (the moment shown): a frame, and the height of the ground there → a point on the ground, a heading. */
WF_API void wf_root_update(wf_root *root, double time, const float *frame, double ground, double point[3],
                           double *heading);

/* ---- where a call goes when a server is many nodes (clients/README.md, "Many nodes") */

typedef struct wf_homes wf_homes;
typedef struct wf_route wf_route;

/* `entry`: the server's address, "http://host:port". Any thread may call. */
WF_API wf_homes *wf_homes_create(const char *entry);
WF_API void wf_homes_destroy(wf_homes *homes);

/* Of one call, or of a stream; outlives `homes`. `about`: a path, or an id; "": nobody's. */
WF_API wf_route *wf_route_create(wf_homes *homes, const char *about);
WF_API void wf_route_destroy(wf_route *route);
/* Where it goes next. Stays until the next call of this route. */
WF_API const char *wf_route_address(const wf_route *route);
/* Start again: as for a new call. */
WF_API void wf_route_begin(wf_route *route);
/* The call has succeeded, or the stream has begun. `made`: id of what was made by it, or "". */
WF_API void wf_route_answered(wf_route *route, const char *made);
/* It was refused: by an HTTP status (0: no answer) and the problem's `endpoint`. Whether it goes on, to the address that
   is now the route's: 1 or 0. */
WF_API int32_t wf_route_refused(wf_route *route, int32_t status, const char *host, int32_t port);
/* A stream has ended, with this code and reason: whether to connect to the route's address at once. */
WF_API int32_t wf_route_closed(wf_route *route, int32_t code, const char *reason);

#ifdef __cplusplus
}
#endif
#endif
