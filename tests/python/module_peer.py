"""Uses the module `bench_dragon` as a user's program does, with global variables, and leaves.

    module_peer.py --name NAME

Needs a scene with cues, at a start before one, that does not loop. Prints a JSON line with what came.
"""

import argparse
import json
import time

from bench_dragon import STATES, Controller, HermiteReader, subscribe

parser = argparse.ArgumentParser()
parser.add_argument("--name", required=True)
name = parser.parse_args().name
feed, reader = subscribe(name, seconds=120), HermiteReader()
alerts, cues, statuses, stage, scene, frames = [], [], [], None, None, []
answer = None
for frame in feed:
    assert frame.handles.shape == (frame.header.handles,) and not frame.handles.flags.writeable
    reader.push(frame.header, frame.handles)
    frames.append((frame.header.sequence, frame.missed, STATES[frame.header.state]))
    alerts += feed.alerts()
    cues += feed.cues()
    statuses += feed.statuses()
    stage, scene = stage or feed.stage(), scene or feed.scene()
    answer = answer or Controller(name).send("state")
    if alerts and cues and len(statuses) > 1 and stage and scene and len(frames) > 100:
        break
moment, handles = reader.at(time.monotonic_ns())
print(
    json.dumps(
        {
            "first": frames[0][0],
            "last": frames[-1][0],
            "frames": len(frames),
            "missed": sum(missed for _, missed, _ in frames),
            "handles": len(handles),
            "answer": answer.code,
            "cue": bytes(cues[0].name).rstrip(b"\0").decode(),
            "benches": stage[0].dragons[0].benches,
            "segments": len(stage[1]),
            "scene": scene[1],
            "alert_run": alerts[0].run_id == stage[0].run_id == scene[0].run_id == cues[0].run_id,
        }
    )
)
