"""Sends a publisher the commands of a test, or a flood of them.

    conduct_peer.py --name NAME table      every command in every state, a JSON line each
    conduct_peer.py --name NAME latency    the duration of a command, in periods and in time
    conduct_peer.py --name NAME flood      requests as fast as they go, until killed
"""

import argparse
import json
import random
import time

from bench_dragon import COMMANDS, CommandRefused, Controller


def line(**fields):
    print(json.dumps(fields), flush=True)


def answer_of(controller, command, value=0.0):
    """Returns the answer to a command, refused or not."""
    try:
        return controller.send(command, value)
    except CommandRefused as refused:
        return refused.answer


def table(controller):
    values = {"rate": 2.0, "seek": 5.0, "step": 3.0}
    states = {
        "playing": [("release", 0), ("resume", 0)],
        "paused": [("release", 0), ("pause", 0)],
        "held": [("hold", 0)],
    }
    for state, steps in states.items():
        for command in COMMANDS:
            for before in [("release", 0), ("resume", 0), ("rate", 1.0), *steps]:
                answer_of(controller, *before)
            answer = answer_of(controller, command, values.get(command, 0.0))
            line(state=state, command=command, code=answer.code, playback=answer.playback, tick=answer.tick)
    answer_of(controller, "release")
    for number, value in ((10, 0.0), (4294967295, 0.0), (3, float("nan")), (3, 1e7), (4, -1.0), (4, 1e9), (5, 0.0), (5, 0.5)):
        answer = answer_of(controller, number, value)
        line(state="any", command=number, value=None if value != value else value, code=answer.code)


def latency(controller):
    chance = random.Random(5)
    for _ in range(60):
        time.sleep(chance.uniform(0.0, 0.05))
        sent = time.monotonic_ns()
        answer = controller.send("state")
        line(ms=(time.monotonic_ns() - sent) / 1e6, tick=answer.tick, code=answer.code)


def flood(controller):
    pending = []
    line(type="flooding")
    while True:
        try:
            pending.append(controller.request("state"))
        except Exception:
            pending.clear()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--name", required=True)
    parser.add_argument("what", choices=["table", "latency", "flood"])
    arguments = parser.parse_args()
    {"table": table, "latency": latency, "flood": flood}[arguments.what](Controller(arguments.name))


if __name__ == "__main__":
    main()
