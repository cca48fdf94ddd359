"""The names of benches and obstacles for people: benches count from 1 within their dragon."""

from __future__ import annotations

from typing import Any


def name_in(stage: Any, number: int) -> str:
    """Returns the name of a bench, or of an obstacle, whose number follows the handles: `bench 9 of gold`, `the well`.

    `stage` is a `Stage`, or a message of `bench_dragon_msgs/Stage`; None before it has come.
    """
    if stage is None or not len(stage.dragons):
        return _own_name(number, None)
    for dragon in stage.dragons:
        if number <= dragon.benches:
            name = _text(dragon.name)
            return f"{_own_name(number, dragon.benches)} of {name}" if name else _own_name(number, dragon.benches)
        number -= dragon.benches + 1
    if number < len(stage.obstacles):
        return f"the {_text(stage.obstacles[number].name)}"
    return f"obstacle {number + 1}"


def _own_name(bench: int, benches: int | None) -> str:
    if bench == 0:
        return "bench 1 (the head)"
    return f"bench {bench + 1} (the tail)" if bench + 1 == benches else f"bench {bench + 1}"


def _text(name: Any) -> str:
    """Returns a text of a message in shared memory, or of ROS 2."""
    return name if isinstance(name, str) else bytes(name).rstrip(b"\0").decode()
