"""Ray, imported with the settings that a cluster needs."""

import os

# A Ray that `ray start` makes needs all but the second, too (docs/cluster-operations.md).
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # no call home
os.environ.setdefault("RAY_DEDUP_LOGS", "0")  # else it swallows lines of nodes that look alike
# in seconds: after a minute without Ray's head, Ray ends processes that wait for it. Entries and
# nodes need no head to find and move sessions
os.environ.setdefault("RAY_gcs_rpc_server_reconnect_timeout_s", "604800")
os.environ.setdefault("RAY_worker_niceness", "0")  # otherwise nodes have nice 15
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # else no node sees a GPU

import ray as ray
from ray.util.scheduling_strategies import (
    NodeAffinitySchedulingStrategy as NodeAffinitySchedulingStrategy,
)
