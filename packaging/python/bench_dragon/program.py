"""The program's computations: one of its commands, and the lines that it answers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any


class ProgramError(RuntimeError):
    """The program refused its input or failed; the text is its own sentence."""


def program() -> str:
    """Returns the program: `BENCH_DRAGON_PROGRAM` names it, or the wheel has put it beside Python, or PATH has it.

    Raises `ProgramError` if there is none.
    """
    beside = Path(sys.executable).with_name("bench-dragon")
    found = os.environ.get("BENCH_DRAGON_PROGRAM") or (str(beside) if beside.exists() else shutil.which("bench-dragon"))
    if not found:
        raise ProgramError("no program bench-dragon in PATH, expected one, or its name in BENCH_DRAGON_PROGRAM")
    return found


def ask(*arguments: object, scene: str | os.PathLike[str] | None = None) -> list[dict[str, Any]]:
    """Returns the lines that a command prints with `--json`: `ask("solve", "--at", "0,60", scene="my.toml")`.

    Without a scene, the command has the paper's, which is built in. Raises `ProgramError` with the program's sentence.
    """
    of_scene = [] if scene is None else ["--scene", os.fspath(scene)]
    command = [program(), *map(str, arguments), *of_scene, "--json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ProgramError(done.stderr.strip() or done.stdout.strip() or f"bench-dragon ended with {done.returncode}")
    return [json.loads(line) for line in done.stdout.splitlines()]
