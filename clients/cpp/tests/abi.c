/* The C ABI, from C: golden messages and a golden character. `abi FOLDER`, where a program in C++ has put them. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "wayfarer/wayfarer.h"

static int failed = 0;
#define CHECK(what) ((what) ? (void)0 : (void)(failed = 1, fprintf(stderr, "%d: %s: %s\n", __LINE__, #what, wf_error())))

static void count_agent(void *user, uint32_t alias) { *(uint32_t *)user += alias; }

static void keep_event(void *user, const char *kind, const char *agent_id, double at, uint32_t goal_revision,
                       uint32_t waypoint, const char *detail) {
  snprintf(user, 100, "%s %s %.6f %u %u %s", kind, agent_id, at, goal_revision, waypoint, detail);
}

static int32_t give(wf_player *player, const char *folder, const char *name, double now) {
  static uint8_t bytes[1 << 20];
  char path[1000];
  FILE *file;
  size_t size;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  file = fopen(path, "rb");
  if (!file) exit(2);
  size = fread(bytes, 1, sizeof bytes, file);
  fclose(file);
  return wf_player_receive(player, bytes, size, now);
}

/* rig.txt: lines "name parent position rotation scale" of a rig with names; the first line counts. */
static wf_rig *read_rig(const char *folder) {
  char path[1000], name[200];
  double p[3], q[4], s[3];
  int parent;
  FILE *file;
  wf_rig *rig = wf_rig_create();
  snprintf(path, sizeof path, "%s/rig.txt", folder);
  file = fopen(path, "r");
  if (!file) exit(2);
  while (fscanf(file, "%199s %d %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf", name, &parent, p, p + 1, p + 2, q, q + 1,
                q + 2, q + 3, s, s + 1, s + 2) == 12)
    CHECK(wf_rig_add(rig, name, parent, p, q, s) >= 0);
  fclose(file);
  return rig;
}

int main(int count, char **values) {
  const char *folder = count > 1 ? values[1] : ".";
  uint32_t added = 0, removed = 0, aliases[4] = {0};
  char event[100] = "";
  const uint8_t junk[2] = {0, 1};
  const float *frame, *offsets;
  size_t width, offset_count;
  double local[4 * WF_BONES], world[4 * WF_BONES], places[3 * WF_BONES], hips[3], point[3], heading;
  const double nowhere[3] = {0, 0, 0}, straight[4] = {0, 0, 0, 1}, whole[3] = {1, 1, 1};
  wf_player *player = wf_player_create();
  wf_rig *rig;
  wf_map *map;
  wf_retarget *retarget;
  wf_root *root;
  wf_homes *homes;
  wf_route *route;

  CHECK(strcmp(wf_version(), "0.2.0") == 0);
  CHECK(wf_bone_number("head") == 15 && strcmp(wf_bone_name(15), "head") == 0);
  CHECK(wf_bone_number("tail") == -1 && wf_bone_name(22) == NULL);

  wf_player_on_added(player, count_agent, &added);
  wf_player_on_removed(player, count_agent, &removed);
  wf_player_on_event(player, keep_event, event);
  CHECK(wf_player_receive(player, junk, sizeof junk, 0) == WF_ERROR);
  CHECK(strcmp(wf_error(), "malformed message: field number 0") == 0);
  CHECK(strcmp(wf_player_basis(player), "") == 0);
  CHECK(give(player, folder, "header", 0) == WF_HEADER);
  CHECK(strcmp(wf_player_basis(player), "gltf") == 0 && wf_player_metres_per_unit(player) == 1);
  CHECK(give(player, folder, "batch", 0) == WF_BATCH);
  CHECK(added == 1 && strcmp(wf_player_resume_token(player), "epoch.0") == 0);
  CHECK(wf_agent_frame(player, 1, NULL) == NULL);
  wf_player_advance(player, 0.1);
  CHECK(wf_player_agents(player, aliases, 4) == 1 && aliases[0] == 1);
  CHECK(strcmp(wf_agent_id(player, 1), "agent-0") == 0 && wf_agent_id(player, 2) == NULL);
  CHECK(wf_agent_state(player, 1) == WF_WALKING && wf_agent_contacts(player, 1) == 3);
  CHECK(wf_agent_tier(player, 1) == 0 && wf_agent_tier(player, 9) == WF_ERROR);
  CHECK(wf_agent_held(player, 1) == 0 && wf_agent_state(player, 9) == WF_ERROR);
  CHECK(wf_player_count(player, "chunks") == 1 && wf_player_count(player, "apples") == 0);
  CHECK(wf_player_buffered(player) > 0 && wf_player_delay(player, 0.1) > 0);
  CHECK(give(player, folder, "event", 0.1) == WF_EVENT);
  CHECK(strcmp(event, "goal_reached a-7 1780000000.123456 3 2 goal 3 of 4 reached") == 0);
  frame = wf_agent_frame(player, 1, &width);
  offsets = wf_agent_rest_offsets(player, 1, &offset_count);
  CHECK(frame != NULL && width == 91 && offset_count == 3 * WF_BONES);

  rig = read_rig(folder);
  CHECK(wf_rig_add(rig, "late", 1000, nowhere, straight, whole) == WF_ERROR);
  map = wf_map_create(rig, "gltf");
  CHECK(map != NULL && strcmp(wf_map_found_by(map), "names") == 0);
  CHECK(wf_map_create(rig, "unitty") == NULL);
  CHECK(wf_rig_correct(rig, "left_knee", NULL) == 0 && wf_map_create(rig, "gltf") == NULL);
  CHECK(wf_map_node(map, wf_bone_number("left_knee")) > 0 && wf_map_node(map, 99) == -1);
  CHECK(wf_map_joints(map, "gltf", places, hips) == 0 && hips[0] == 0 && places[3] > 0 && places[1] > 0.5);
  CHECK(wf_map_joints(map, "unitty", places, hips) == WF_ERROR);
  CHECK(wf_map_correct(map, "left_knee", NULL) == WF_ERROR);
  CHECK(strstr(wf_error(), "no node was found for left_knee") != NULL && wf_map_node(map, 4) > 0);
  CHECK(wf_map_correct(map, "head", NULL) == 0 && wf_map_node(map, 15) == -1);
  CHECK(strcmp(wf_map_found_by(map), "user") == 0);
  retarget = wf_retarget_create(map, offsets, offset_count, "gltf", NAN);
  CHECK(wf_retarget_create(map, offsets, 9, "gltf", NAN) == NULL);
  CHECK(wf_retarget_pose(retarget, frame, 7, NAN) == WF_ERROR);
  CHECK(wf_retarget_pose(retarget, frame, width, NAN) == 0);
  wf_retarget_local(retarget, local);
  wf_retarget_world(retarget, world, places);
  wf_retarget_hips(retarget, hips);
  CHECK(fabs(wf_retarget_ratio(retarget) - 1) < 0.5 && places[1] > 0.5 && fabs(world[3]) <= 1);
  CHECK(fabs(local[3]) <= 1 && hips[0] == hips[0] && fabs(wf_retarget_ground(retarget)) < 0.1);
  root = wf_root_create("gltf", 1);
  wf_root_update(root, 0, frame, 0, point, &heading);
  CHECK(point[1] == 0 && fabs(point[0] - frame[0]) < 1e-6 && heading == heading);

  homes = wf_homes_create("https://entry");
  route = wf_route_create(homes, "/v1/sessions");
  CHECK(strcmp(wf_route_address(route), "https://entry") == 0);
  CHECK(wf_route_refused(route, 422, "", 0) == 0 && wf_route_refused(route, 421, "a", 7) == 1);
  CHECK(strcmp(wf_route_address(route), "https://a:7") == 0);
  wf_route_answered(route, "session-00ff12");
  wf_route_destroy(route);
  route = wf_route_create(homes, "agent-00ff34");
  wf_homes_destroy(homes);
  CHECK(strcmp(wf_route_address(route), "https://a:7") == 0);
  CHECK(wf_route_closed(route, 4421, "call b:8") == 1 && wf_route_closed(route, 1006, "") == 0);
  wf_route_begin(route);
  CHECK(strcmp(wf_route_address(route), "https://entry") == 0);
  wf_route_destroy(route);

  wf_player_clear(player);
  CHECK(removed == 1);
  wf_root_destroy(root);
  wf_retarget_destroy(retarget);
  wf_map_destroy(map);
  wf_rig_destroy(rig);
  wf_player_destroy(player);
  wf_player_destroy(NULL);
  return failed;
}
