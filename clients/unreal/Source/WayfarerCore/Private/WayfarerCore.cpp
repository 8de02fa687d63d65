// The sources of clients/cpp, without any header of the engine.

#include "bases.cpp"
#include "bone_map.cpp"
#include "homes.cpp"
#include "messages.cpp"
#include "player.cpp"
#include "playout.cpp"
#include "poses.cpp"
#include "retarget.cpp"
#include "rig.cpp"
#include "root.cpp"
#include "tiers.cpp"
#include "wayfarer_c.cpp"
