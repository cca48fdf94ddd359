"""The handles of a frame as numpy arrays, where the publisher wrote them."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt

from bench_dragon.layouts import HandlePose, HandlePose32

# A structured array of handles: the fields of `HandlePose`, x, y (metres), heading (radians), vx, vy (metres per
# simulated second).
Handles = npt.NDArray[np.void]

# One handle of `<name>/poses`: 40 bytes, double precision.
HANDLE_POSE: np.dtype[np.void] = np.dtype([(field[0], "<f8") for field in HandlePose._fields_])
# One handle of `<name>/poses32`: 20 bytes, single precision.
HANDLE_POSE_32: np.dtype[np.void] = np.dtype([(field[0], "<f4") for field in HandlePose32._fields_])


def handles_of(sample: Any) -> Handles:
    """Returns the handles of a sample of iceoryx2 without copying, in the precision of its service: shape (handles,).

    The array is read-only and valid only until `sample.delete()`: copy data for later use.
    """
    count = sample.header.number_of_elements
    kind = HANDLE_POSE_32 if sample.payload().contained_type is HandlePose32 else HANDLE_POSE
    memory = (ctypes.c_char * (count * kind.itemsize)).from_address(sample.payload_ptr)
    view = np.frombuffer(memory, kind)
    view.flags.writeable = False
    return view


def indices_of(poses32: Any, *handles: int) -> npt.NDArray[np.int64]:
    """Returns the index of the handle of each pose of the service `<name>/poses32`: shape (poses,).

    `poses32` is the opened service, `handles` the number of handles of the team, or of each of several dragons in the
    order of the stage.
    """
    attributes = {attribute.key.to_string(): attribute.value.to_string() for attribute in poses32.attributes.values}
    parts: list[npt.NDArray[np.int64]] = []
    first = 0
    for count in handles:
        parts.append(np.append(np.arange(first, first + count - 1, int(attributes["every"])), first + count - 1))
        first += count
    return np.concatenate(parts)
