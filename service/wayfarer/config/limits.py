"""Limits of requests: one value from the settings, which all packages use unchanged."""

from pydantic import BaseModel, ConfigDict, Field

from wayfarer.navigation.scene_spec import MAX_MESH_BYTES


class Limits(BaseModel):
    """Limits of a client's requests, reported by GetServerInfo."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    agents_per_call: int = Field(
        default=64, ge=1, le=1024, description="agents in one CreateAgents call"
    )
    agents_per_session: int = Field(default=256, ge=1, description="agents of one session")
    agents: int = Field(default=256, ge=1, description="agents on the server")
    sessions: int = Field(default=64, ge=1, description="sessions on the server")
    streams_per_session: int = Field(default=8, ge=1, description="streams of one session")
    streams: int = Field(default=64, ge=1, description="streams on the server")
    message_bytes: int = Field(default=1 << 20, ge=1024, description="bytes of one request")
    goal_distance_m: float = Field(
        default=1000.0,
        gt=0,
        description="metres from an agent to its goal, or from one goal to the next",
    )
    lease_s: float = Field(
        default=86_400.0, ge=1, description="longest lease of a session, in seconds"
    )
    path_goals: int = Field(default=256, ge=1, le=1024, description="goals of one path")
    queue_s: float = Field(
        default=0.5, ge=0.2, le=60, description="seconds of motion that may wait for a slow reader"
    )
    resume_s: float = Field(
        default=5.0, ge=0, le=60, description="seconds of motion kept for streams that resume"
    )
    lead_s: float = Field(
        default=0.5, ge=0.2, le=60, description="seconds sent ahead of an acknowledged playhead"
    )
    clip_s: float = Field(default=120.0, gt=0, le=3600, description="seconds of one clip")
    offline_jobs: int = Field(
        default=2, ge=1, le=64, description="clips, replays and lock-step calls at the same time"
    )
    steps_per_call: int = Field(
        default=50, ge=1, le=1000, description="primitives of one StepAgents call"
    )
    log_entries: int = Field(default=100_000, ge=1, description="recorded commands of one session")
    sessions_per_caller: int = Field(default=32, ge=1, description="sessions of one caller")
    calls_per_second: int = Field(
        default=100,
        ge=1,
        description="calls of one caller per second, with bursts of twice as many",
    )
    scenes: int = Field(default=64, ge=1, description="scenes on the server")
    scenes_per_caller: int = Field(default=16, ge=1, description="scenes of one caller")
    mesh_bytes: int = Field(
        default=16 << 20, ge=1024, le=MAX_MESH_BYTES, description="bytes of the mesh of a scene"
    )
    bake_s: float = Field(
        default=20.0,
        ge=1,
        le=600,
        description="seconds of CPU time that baking a scene may take",
    )
    bake_mb: int = Field(
        default=1024,
        ge=256,
        le=1 << 20,
        description="megabytes of memory that baking a scene may take (enforced on Linux only)",
    )
