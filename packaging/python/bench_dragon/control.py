"""Commands to a running publisher.

    controller = Controller("bench_dragon")
    answer = controller.send("seek", 400.0)
"""

from __future__ import annotations

import time
from typing import Any

import iceoryx2 as iox2

from bench_dragon.layouts import PLAYBACK, ControlRequest, ControlResponse
from bench_dragon.services import layout_error, new_node

COMMANDS = ("state", "pause", "resume", "rate", "seek", "step", "restart", "hold", "release", "go")
CODES = ("done", "already so", "refused in this state", "value out of range", "not understood", "too many waiting")

ControlRequest.NAMES = {"command": dict(enumerate(COMMANDS))}
ControlResponse.NAMES = {"code": dict(enumerate(CODES)), "playback": dict(enumerate(PLAYBACK))}

# Seconds between two looks for an answer.
POLL_INTERVAL = 0.0005


class CommandRefused(RuntimeError):
    """The publisher refuses a command, in a sentence. `answer` is its response, with the state of the show."""

    def __init__(self, command: str | int, answer: ControlResponse) -> None:
        """Creates the error of a command and the response to it."""
        name = COMMANDS[command] if isinstance(command, int) and 0 <= command < len(COMMANDS) else command
        super().__init__(f"{name} is refused: {described(answer)}")
        self.answer = answer


class Controller:
    """A client of `<name>/control`. Keep it as long as commands follow; `close` it, or use it in `with`."""

    def __init__(self, name: str = "bench_dragon") -> None:
        """Connects to a publisher that runs. Raises ConnectionError if no publisher runs."""
        service = f"{name}/control"
        self._node = new_node()
        builder = self._node.service_builder(iox2.ServiceName.new(service))
        try:
            opened = builder.request_response(ControlRequest, ControlResponse).open()
        except iox2.RequestResponseOpenError as error:
            if "IncompatibleRequestOrResponseType" in str(error):
                raise layout_error(service, [ControlRequest, ControlResponse]) from error
            raise ConnectionError(f'no publisher has the name "{name}"') from error
        self._client = opened.client_builder().create()
        self._sent = 0

    def send(self, command: str | int, value: float = 0.0, timeout: float = 10.0) -> ControlResponse:
        """Sends a command by name or number and returns the response, in its own memory.

        `value`: simulated seconds per second for `rate`, simulated seconds for `seek`, periods for `step`, else 0.
        Raises `CommandRefused` if the publisher refuses the command, ValueError for an unknown name, TimeoutError
        without an answer within `timeout` seconds.
        """
        if isinstance(command, str) and command not in COMMANDS:
            raise ValueError(f'no command is called "{command}": expected one of {", ".join(COMMANDS)}')
        pending = self.request(command, value)
        end = time.monotonic() + timeout
        while True:
            # An answer that came while this process did not run is there after the end.
            is_last = time.monotonic() >= end
            response = pending.receive()
            if response is not None:
                answer = ControlResponse.from_buffer_copy(response.payload().contents)
                response.delete()
                if answer.code > CODES.index("already so"):
                    raise CommandRefused(command, answer)
                return answer
            if is_last:
                raise TimeoutError(f"no answer to {command} within {timeout} s")
            time.sleep(POLL_INTERVAL)

    def request(self, command: str | int, value: float = 0.0) -> Any:
        """Sends a command and returns iceoryx2's pending response, without waiting."""
        self._sent += 1
        number = COMMANDS.index(command) if isinstance(command, str) else command
        return self._client.send_copy(ControlRequest(id=self._sent, value=value, command=number, reserved=0))

    def close(self) -> None:
        """Leaves the publisher."""
        self._client = self._node = None

    def __enter__(self) -> Controller:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def described(answer: ControlResponse) -> str:
    """Returns an answer in words: `done: paused at 0.0 x, t = 402.850 s, tick 171`."""
    return (
        f"{CODES[answer.code]}: {PLAYBACK[answer.playback]} at {answer.time_scale} x, "
        f"t = {answer.sim_time:.3f} s, tick {answer.tick}"
    )
