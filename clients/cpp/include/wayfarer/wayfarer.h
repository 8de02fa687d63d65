/* The core for C and for engine plug-ins: opaque handles, pointers and scalars; no structs, no exceptions.

   One thread uses a handle at a time; different handles may be used in parallel. The code that creates a handle
   destroys it, once; NULL is allowed. A call that fails returns NULL or WF_ERROR, and wf_error() gives the reason.
   Strings are UTF-8; returned strings stay until the handle or the agent is gone. The caller owns arrays. Times are
   seconds. Quaternions are x, y, z, w. */
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

/* Why this thread's last call failed. */
WF_API const char *wf_error(void);
/* "0.2.0" */
WF_API const char *wf_version(void);
/* NULL for an unknown number; -1 for an unknown name. */
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
/* Take a binary frame that came at local `now`. Returns its kind, or WF_ERROR: then close the connection. */
WF_API int32_t wf_player_receive(wf_player *player, const uint8_t *message, size_t size, double now);
/* Show all agents as at local `now`. Returns the moment shown: the server's clock, seconds since 1970. */
WF_API double wf_player_advance(wf_player *player, double now);
/* Forget all agents, as if they were removed. */
WF_API void wf_player_clear(wf_player *player);
/* The token from which the next stream resumes (?resume_token=); "" at first. Stays until the next message. */
WF_API const char *wf_player_resume_token(const wf_player *player);
/* The stream's basis, as in the API; "" before the header. */
WF_API const char *wf_player_basis(const wf_player *player);
WF_API double wf_player_metres_per_unit(const wf_player *player);
/* Seconds between a frame's time and its display; seconds queued for the agent that has the least. */
WF_API double wf_player_delay(wf_player *player, double now);
WF_API double wf_player_buffered(const wf_player *player);
/* Counts since the start: "messages", "bytes", "chunks", "frames", "gaps", "reduced", "held", "underruns"; 0 for any
   other name. */
WF_API uint64_t wf_player_count(const wf_player *player, const char *what);

/* Callbacks of wf_player_receive. They must not call the player, except for the functions wf_agent_…. */
typedef void (*wf_agent_callback)(void *user, uint32_t alias);
typedef void (*wf_chunk_callback)(void *user, uint32_t alias, uint32_t flags, uint32_t goal_revision,
                                  uint32_t waypoint);
/* `kind` such as "path_done", `detail` in words; `agent_id` is "" for events of the stream or the server. */
typedef void (*wf_event_callback)(void *user, const char *kind, const char *agent_id, double at,
                                  uint32_t goal_revision, uint32_t waypoint, const char *detail);
WF_API void wf_player_on_added(wf_player *player, wf_agent_callback call, void *user);
WF_API void wf_player_on_removed(wf_player *player, wf_agent_callback call, void *user);
WF_API void wf_player_on_chunk(wf_player *player, wf_chunk_callback call, void *user);
WF_API void wf_player_on_event(wf_player *player, wf_event_callback call, void *user);

/* Aliases of the agents, at most `room` of them; returns the number of agents. */
WF_API size_t wf_player_agents(const wf_player *player, uint32_t *aliases, size_t room);
/* Properties of an agent; NULL, 0 or WF_ERROR when it is unknown. */
WF_API const char *wf_agent_id(const wf_player *player, uint32_t alias);
WF_API const char *wf_agent_name(const wf_player *player, uint32_t alias);
WF_API const float *wf_agent_rest_offsets(const wf_player *player, uint32_t alias, size_t *count);
/* The pose at the moment shown: hips x, y, z, then x, y, z, w per bone. NULL before the first. `count`: numbers. */
WF_API const float *wf_agent_frame(const wf_player *player, uint32_t alias, size_t *count);
WF_API int32_t wf_agent_state(const wf_player *player, uint32_t alias);
/* Number of an agent's ring in a stream with levels of detail; 0 is the nearest. An agent that leaves the last ring is
   removed, and added when it comes again. */
WF_API int32_t wf_agent_tier(const wf_player *player, uint32_t alias);
/* 1 left foot, 2 right foot on the ground; whether frames have run out, and the last one is held. */
WF_API int32_t wf_agent_contacts(const wf_player *player, uint32_t alias);
WF_API int32_t wf_agent_held(const wf_player *player, uint32_t alias);

/* ---- a character: its nodes at rest, their map to bones, and poses on it */

typedef struct wf_rig wf_rig;
typedef struct wf_map wf_map;
typedef struct wf_retarget wf_retarget;

WF_API wf_rig *wf_rig_create(void);
WF_API void wf_rig_destroy(wf_rig *rig);
/* Add a node, its parent before it (-1: none), with its rest transform relative to the parent. Returns its number. */
WF_API int32_t wf_rig_add(wf_rig *rig, const char *name, int32_t parent, const double position[3],
                          const double rotation[4], const double scale[3]);
/* Give a node its name in VRM's table. */
WF_API int32_t wf_rig_humanoid(wf_rig *rig, const char *vrm_name, int32_t node);

/* Map a node to a bone (node_name NULL: none) before wf_map_create, which refuses a rig whose hips or legs it cannot
   find. */
WF_API int32_t wf_rig_correct(wf_rig *rig, const char *bone, const char *node_name);

/* Find the bones; `basis` of the rig's space, as in the API ("gltf", "unreal_mannequin" …). */
WF_API wf_map *wf_map_create(const wf_rig *rig, const char *basis);
WF_API void wf_map_destroy(wf_map *map);
/* "vrm", "names", "shape", "user" */
WF_API const char *wf_map_found_by(const wf_map *map);
/* Node of a bone; -1: the rig lacks it. */
WF_API int32_t wf_map_node(const wf_map *map, int32_t bone);
/* Map a node to a bone (NULL: none). 0, or WF_ERROR with the map as before. */
WF_API int32_t wf_map_correct(wf_map *map, const char *bone, const char *node_name);

/* Measure the soles from the mesh at rest: vertices [count][3] in the rig's space, and the node that moves each most.
   Everything made from the map afterwards uses them. Returns 1; 0: a foot has no vertices; or WF_ERROR. */
WF_API int32_t wf_map_soles(wf_map *map, const char *basis, const double *places, const int32_t *nodes, size_t count);

/* Places [22][3] of the joints at rest, upright in the basis (of the rig's handedness), and the height of the floor
(NAN:
   unknown): the input of POST /v1/bodies:fit, for an agent with the character's proportions. */
WF_API int32_t wf_map_joints(const wf_map *map, const char *basis, double *places, double *floor);

/* `rest_offsets` of the agent; `floor`: height of the character's soles at rest (NAN: find it). Both, and the rig, are
in
   the basis and unit of the stream. */
WF_API wf_retarget *wf_retarget_create(const wf_map *map, const float *rest_offsets, size_t count,
                                       const char *basis, double floor);
WF_API void wf_retarget_destroy(wf_retarget *retarget);
/* Put a frame of the agent (wf_agent_frame) on the character. `ground`: height of the ground there (NAN: that of the
   lower sole). 0, or WF_ERROR when the frame has fewer than the 22 bones. */
WF_API int32_t wf_retarget_pose(wf_retarget *retarget, const float *frame, size_t count, double ground);
/* Results of the last pose, for the 22 bones (bones that the rig lacks are left out, see wf_map_node): rotations
relative
   to the nodes' parents, [22][4]; the same in the world; places in the world, [22][3]. */
WF_API void wf_retarget_local(const wf_retarget *retarget, double *rotations);
WF_API void wf_retarget_world(const wf_retarget *retarget, double *rotations, double *places);
/* Place of a bone's node relative to its parent. 1: set it, for the hips and for bones that hang from another bone than
   they follow. 0: it stays. */
WF_API int32_t wf_retarget_moved(const wf_retarget *retarget, int32_t bone, double place[3]);
/* The same for the hips. */
WF_API void wf_retarget_hips(const wf_retarget *retarget, double place[3]);
/* Height of the character's thigh joints relative to the agent's. */
WF_API double wf_retarget_ratio(const wf_retarget *retarget);
/* Height of the ground of the last pose: the given one, or that of the lower sole. */
WF_API double wf_retarget_ground(const wf_retarget *retarget);

/* ---- a smooth root, for capsules, cameras and root motion */

typedef struct wf_root wf_root;

WF_API wf_root *wf_root_create(const char *basis, double metres_per_unit);
WF_API void wf_root_destroy(wf_root *root);
/* At `time` (the moment shown): a frame, and the height of the ground there → a point on the ground, a heading. */
WF_API void wf_root_update(wf_root *root, double time, const float *frame, double ground, double point[3],
                           double *heading);

/* ---- routes of calls when a server is many nodes (clients/README.md, "Many nodes") */

typedef struct wf_homes wf_homes;
typedef struct wf_route wf_route;

/* `entry`: the server's address, "http://host:port". Any thread may call. */
WF_API wf_homes *wf_homes_create(const char *entry);
WF_API void wf_homes_destroy(wf_homes *homes);

/* The route of one call, or of a stream; outlives `homes`. `about`: a path, or an id; "": none. */
WF_API wf_route *wf_route_create(wf_homes *homes, const char *about);
WF_API void wf_route_destroy(wf_route *route);
/* Where it goes next. Stays until the next call of this route. */
WF_API const char *wf_route_address(const wf_route *route);
/* Start again, as for a new call. */
WF_API void wf_route_begin(wf_route *route);
/* The call has succeeded, or the stream has begun. `made`: id of what was made by it, or "". */
WF_API void wf_route_answered(wf_route *route, const char *made);
/* Note a refusal, by an HTTP status (0: no answer) and the problem's `endpoint`. Returns 1 if the call continues, to
the
   address that is now the route's; otherwise 0. */
WF_API int32_t wf_route_refused(wf_route *route, int32_t status, const char *host, int32_t port);
/* Note the end of a stream, with code and reason. Returns whether to connect to the route's address at once. */
WF_API int32_t wf_route_closed(wf_route *route, int32_t code, const char *reason);

#ifdef __cplusplus
}
#endif
#endif
