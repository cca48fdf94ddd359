"""Subscribing to a bench dragon, and conducting it, from Python.

    from bench_dragon import subscribe

    for frame in subscribe("bench_dragon"):
        x = frame.handles["x"]                   # metres, a numpy array in the publisher's own memory

`subscribe` returns a `Feed`: frames, alerts, cues, statuses, the stage. `Controller` sends commands. `HermiteReader`
gives the handles between two frames. All messages have the layouts of the program of the same version.
"""

from bench_dragon.control import CODES, COMMANDS, Controller, described
from bench_dragon.feed import Feed, Frame, subscribe
from bench_dragon.frames import HANDLE_POSE, HANDLE_POSE_32, Handles, handles_of, indices_of
from bench_dragon.hermite import HermiteReader
from bench_dragon.layouts import (
    EVENTS,
    LEVELS,
    MESSAGES,
    NO_BENCH,
    OBSTACLES,
    PLAYBACK,
    SEGMENTS,
    STATES,
    ChaseStatus,
    CollisionAlert,
    ControlRequest,
    ControlResponse,
    Cue,
    FrameHeader,
    HandlePose,
    HandlePose32,
    LoopStatus,
    Message,
    SceneHeader,
    Stage,
    StageCue,
    StageDragon,
    StageEvent,
    StageObstacle,
    StageSegment,
)
from bench_dragon.services import LayoutError

__all__ = [
    "CODES",
    "COMMANDS",
    "ChaseStatus",
    "CollisionAlert",
    "ControlRequest",
    "ControlResponse",
    "Controller",
    "Cue",
    "EVENTS",
    "Feed",
    "Frame",
    "FrameHeader",
    "HANDLE_POSE",
    "HANDLE_POSE_32",
    "HandlePose",
    "HandlePose32",
    "Handles",
    "HermiteReader",
    "LEVELS",
    "LayoutError",
    "LoopStatus",
    "MESSAGES",
    "Message",
    "NO_BENCH",
    "OBSTACLES",
    "PLAYBACK",
    "SEGMENTS",
    "STATES",
    "SceneHeader",
    "Stage",
    "StageCue",
    "StageDragon",
    "StageEvent",
    "StageObstacle",
    "StageSegment",
    "described",
    "handles_of",
    "indices_of",
    "subscribe",
]
