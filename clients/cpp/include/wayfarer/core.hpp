// The core: no engine, no clock, no socket, no thread. Bytes and times go in, poses come out.
#pragma once

#include "wayfarer/bases.hpp"
#include "wayfarer/bone_map.hpp"
#include "wayfarer/homes.hpp"
#include "wayfarer/messages.hpp"
#include "wayfarer/player.hpp"
#include "wayfarer/playout.hpp"
#include "wayfarer/poses.hpp"
#include "wayfarer/quaternions.hpp"
#include "wayfarer/retarget.hpp"
#include "wayfarer/rig.hpp"
#include "wayfarer/root.hpp"
#include "wayfarer/soles.hpp"
#include "wayfarer/tiers.hpp"
