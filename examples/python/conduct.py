"""Controls a running publisher from Python: `pip install iceoryx2==0.10.0 numpy`, start a publisher, run this.

    python3 examples/python/conduct.py [--name bench_dragon] pause | resume | rate 2 | seek 400 | step 10 | hold | ...

Without a command it plays a short scene: half speed, a pause of a second, and resume.
"""

import argparse
import sys
import time

from bench_dragon import COMMANDS, CommandRefused, Controller, described


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", default="bench_dragon")
    parser.add_argument("command", nargs="?", choices=COMMANDS)
    parser.add_argument("value", nargs="?", type=float, default=0.0)
    arguments = parser.parse_args()
    controller = Controller(arguments.name)
    if arguments.command:
        print(described(controller.send(arguments.command, arguments.value)))
        return
    for command, value, seconds in (("rate", 0.5, 2.0), ("pause", 0.0, 1.0), ("rate", 1.0, 0.0), ("resume", 0.0, 0.0)):
        print(f"{command:<7}", described(controller.send(command, value)), flush=True)
        time.sleep(seconds)


if __name__ == "__main__":
    try:
        main()
    except CommandRefused as refused:
        sys.exit(str(refused))
