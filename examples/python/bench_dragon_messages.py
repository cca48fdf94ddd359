"""The memory layouts of bench-dragon's messages, once, for every Python subscriber.

Each class is what iceoryx2 compares with the publisher's type: its name ends in the layout's version, so that a
publisher with another layout is refused. `HANDLE_POSE` is the numpy view of a frame's handles.
"""

import ctypes

import numpy as np

NO_BENCH = 0xFFFFFFFF
STATES = ("moving", "approaching", "contact", "stall", "lock", "path_end")
LEVELS = ("clear", "approaching", "contact", "stall", "lock")
EVENTS = {0: None, 2: "contact", 3: "stall", 4: "lock", 5: "path_end"}
PLAYBACK = ("playing", "paused", "held", "ended")


class _Message(ctypes.Structure):
    LAYOUT = 1

    @classmethod
    def type_name(cls) -> str:
        return f"bench_dragon/{cls.__name__}/{cls.LAYOUT}"


class HandlePose(_Message):
    _fields_ = [(name, ctypes.c_double) for name in ("x", "y", "heading", "vx", "vy")]


class FrameHeader(_Message):
    """What is true of a whole frame: `STATES[state]`, `PLAYBACK[playback]`; epoch grows when simulated time jumps."""

    LAYOUT = 2
    _fields_ = [
        (name, ctypes.c_uint64) for name in ("run_id", "sequence", "tick", "stamp_ns", "sent_ns", "deadline_ns")
    ] + [
        ("sim_time", ctypes.c_double),
        ("time_scale", ctypes.c_double),
        ("min_clearance", ctypes.c_double),
    ] + [(name, ctypes.c_uint32) for name in ("handles", "state", "playback", "cue", "epoch", "reserved")]


class CollisionAlert(_Message):
    """The nearest two boards now, and the event the alert is about: `LEVELS[level]`, `EVENTS[event]`."""

    LAYOUT = 2
    _fields_ = (
        [(name, ctypes.c_uint64) for name in ("run_id", "tick", "stamp_ns")]
        + [
            (name, ctypes.c_double)
            for name in ("sim_time", "event_time", "time_to_event", "clearance", "x", "y", "event_x", "event_y")
        ]
        + [
            (name, ctypes.c_uint32)
            for name in ("level", "bench_a", "bench_b", "event", "event_bench_a", "event_bench_b")
        ]
    )


class LoopStatus(_Message):
    LAYOUT = 2
    _fields_ = (
        [(name, ctypes.c_uint64) for name in ("run_id", "tick", "sequence", "stamp_ns")]
        + [(name, ctypes.c_double) for name in ("sim_time", "rate", "measured_rate")]
        + [
            (name, ctypes.c_uint64)
            for name in (
                "overruns",
                "skipped",
                "shows_played",
                "unforeseen_contacts",
                "unsolved_frames",
                "lateness_p50_second",
                "lateness_p99_second",
                "lateness_max_second",
                "lateness_p50_total",
                "lateness_p99_total",
                "lateness_p999_total",
                "lateness_max_total",
                "step_p50_second",
                "step_p99_second",
                "step_max_second",
                "step_p50_total",
                "step_p99_total",
                "step_p999_total",
                "step_max_total",
                "resident_bytes",
            )
        ]
        + [("subscribers", ctypes.c_uint32), ("file_descriptors", ctypes.c_uint32), ("scene", ctypes.c_uint8 * 64)]
    )


SEGMENTS = ("line", "arc", "inward_spiral", "outward_spiral")


class StageSegment(ctypes.Structure):
    """One segment of the path; `SEGMENTS[kind]` says which curve it is."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in ("x", "y", "heading", "length", "curvature", "theta_first", "theta_last")
    ] + [("kind", ctypes.c_uint32), ("reserved", ctypes.c_uint32)]


class Stage(_Message):
    """The team's measures and the path: `path[:segments]`."""

    LAYOUT = 3
    _fields_ = (
        [("run_id", ctypes.c_uint64), ("stamp_ns", ctypes.c_uint64)]
        + [
            (name, ctypes.c_double)
            for name in ("pitch", "start_turn", "hole_inset", "head_length", "body_length", "width")
        ]
        + [("benches", ctypes.c_uint32), ("segments", ctypes.c_uint32), ("path", StageSegment * 32)]
    )


MESSAGES = (HandlePose, FrameHeader, CollisionAlert, LoopStatus, Stage)

HANDLE_POSE = np.dtype([(name, "<f8") for name, _ in HandlePose._fields_])


def handles_of(sample) -> np.ndarray:
    """The handles of a frame as a numpy structured array, without copying.

    The array is read-only and lives only until `sample.delete()`: copy what is to be kept.
    """
    count = sample.header.number_of_elements
    memory = (ctypes.c_char * (count * HANDLE_POSE.itemsize)).from_address(sample.payload_ptr)
    view = np.frombuffer(memory, HANDLE_POSE)
    view.flags.writeable = False
    return view
