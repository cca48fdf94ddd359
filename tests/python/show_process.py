"""The programs of one service name, for scripts that test a show: they end with a block, and answer for its state."""

import contextlib
import json
import subprocess
import time


class ShowProcess:
    """The program under a service name."""

    def __init__(self, program, name):
        self.program, self.name = program, name

    @contextlib.contextmanager
    def started(self, *arguments):
        """A process that is killed at the end."""
        child = subprocess.Popen([self.program, "--name", self.name, *arguments], stdout=subprocess.PIPE, text=True)
        try:
            yield child
        finally:
            child.kill()
            child.wait()

    def state(self):
        """Returns the state of the show, or None if no publisher runs."""
        asked = subprocess.run([self.program, "--name", self.name, "--json", "control", "state"], capture_output=True)
        return json.loads(asked.stdout) if asked.returncode == 0 else None

    def until(self, condition, what, seconds=120):
        """Returns the value of a condition as soon as it is true."""
        deadline = time.monotonic() + seconds
        while not (value := condition()):
            assert time.monotonic() < deadline, f"{what}: not within {seconds} s; the show: {self.state()}"
            time.sleep(0.02)
        return value
