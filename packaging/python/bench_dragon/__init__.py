"""Subscribing to a bench dragon, and conducting it, from Python.

    from bench_dragon import subscribe

    for frame in subscribe("bench_dragon"):
        x = frame.handles["x"]                   # metres, a numpy array in the publisher's own memory

`subscribe` returns a `Feed`: frames, alerts, cues, statuses, the stage. `Controller` sends commands; one that is
refused raises `CommandRefused`. `HermiteReader` gives the handles between two frames, `name_in` the names of benches and
obstacles. `ask` returns the lines that a command of the program prints with `--json`. All messages have the layouts of
the program of the same version; `print` shows their fields, states and levels by name.
"""

import importlib
from typing import TYPE_CHECKING, Any

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
from bench_dragon.names import name_in
from bench_dragon.program import ProgramError, ask

if TYPE_CHECKING:
    from bench_dragon.control import CODES, COMMANDS, CommandRefused, Controller, described
    from bench_dragon.feed import Feed, Frame, subscribe
    from bench_dragon.services import LayoutError

# The names of modules that need iceoryx2, which a subscriber over ROS 2 may lack: they are imported when first used.
_IN_MODULES = {
    "control": ("CODES", "COMMANDS", "CommandRefused", "Controller", "described"),
    "feed": ("Feed", "Frame", "subscribe"),
    "services": ("LayoutError",),
}


def __getattr__(name: str) -> Any:
    for module, names in _IN_MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "CODES",
    "COMMANDS",
    "ChaseStatus",
    "CollisionAlert",
    "CommandRefused",
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
    "ProgramError",
    "SEGMENTS",
    "STATES",
    "SceneHeader",
    "Stage",
    "StageCue",
    "StageDragon",
    "StageEvent",
    "StageObstacle",
    "StageSegment",
    "ask",
    "described",
    "handles_of",
    "indices_of",
    "name_in",
    "subscribe",
]
