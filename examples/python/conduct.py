"""Controls a running publisher from Python: `pip install iceoryx2==0.10.0 numpy`, start a publisher, run this.

    python3 examples/python/conduct.py [--name bench_dragon] pause | resume | rate 2 | seek 400 | step 10 | hold | ...

Without a command it plays a short scene: half speed, a pause of a second, and resume.
"""

import argparse
import time

import iceoryx2 as iox2
from bench_dragon_messages import PLAYBACK, ControlRequest, ControlResponse

iox2.set_log_level(iox2.LogLevel.Fatal)

COMMANDS = ("state", "pause", "resume", "rate", "seek", "step", "restart", "hold", "release", "go")
CODES = ("done", "already so", "refused in this state", "value out of range", "not understood", "too many waiting")


class Conductor:
    """A client of `<name>/control`."""

    def __init__(self, name):
        self._node = (
            iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        )
        service = self._node.service_builder(iox2.ServiceName.new(f"{name}/control"))
        self._client = service.request_response(ControlRequest, ControlResponse).open().client_builder().create()
        self._sent = 0

    def send(self, command, value=0.0, timeout=5.0):
        """Sends a command by name or number and returns the response as a ControlResponse in its own memory."""
        self._sent += 1
        number = COMMANDS.index(command) if isinstance(command, str) else command
        request = ControlRequest(id=self._sent, value=value, command=number, reserved=0)
        pending = self._client.send_copy(request)
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            response = pending.receive()
            if response is not None:
                answer = ControlResponse.from_buffer_copy(response.payload().contents)
                response.delete()
                return answer
            time.sleep(0.0005)
        raise TimeoutError(f"no answer to {command} within {timeout} s")


def described(answer):
    return (
        f"{CODES[answer.code]}: {PLAYBACK[answer.playback]} at {answer.time_scale} x, "
        f"t = {answer.sim_time:.3f} s, tick {answer.tick}"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("command", nargs="?", choices=COMMANDS)
    parser.add_argument("value", nargs="?", type=float, default=0.0)
    arguments = parser.parse_args()
    conductor = Conductor(arguments.name)
    if arguments.command:
        print(described(conductor.send(arguments.command, arguments.value)))
        return
    for command, value, seconds in (("rate", 0.5, 2.0), ("pause", 0.0, 1.0), ("rate", 1.0, 0.0), ("resume", 0.0, 0.0)):
        print(f"{command:<7}", described(conductor.send(command, value)), flush=True)
        time.sleep(seconds)


if __name__ == "__main__":
    main()
