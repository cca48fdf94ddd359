#!/usr/bin/env python3
"""The paper scene as it is usually solved today: SciPy's fsolve, once per handle and per time.

    python3 benches/peers/fsolve.py [frames]

Prints the milliseconds of a frame with 224 handles, positions and speeds; needs numpy and scipy. The program follows
the exact motion of the head (theta from the arc length, by fsolve too) and rigidity for the speeds. Its answer is
therefore the answer of the live program, found in the usual way. The check against the live program's own numbers:

    bench-dragon solve --at 300
"""

import sys
import time

import numpy as np
from scipy.optimize import fsolve

GROWTH = 0.55 / (2 * np.pi)
START = 32 * np.pi
LINKS = [2.86] + 222 * [1.65]


def arc_length(theta):
    return 0.5 * GROWTH * (theta * np.sqrt(1 + theta**2) + np.arcsinh(theta))


def point(theta):
    return GROWTH * theta * np.array([np.cos(theta), np.sin(theta)])


def tangent(theta):
    slope = -GROWTH * np.array([np.cos(theta) - theta * np.sin(theta), np.sin(theta) + theta * np.cos(theta)])
    return slope / np.hypot(*slope)


def frame(t):
    theta = fsolve(lambda angle: arc_length(START) - arc_length(angle[0]) - t, np.sqrt(START**2 - 2 * t / GROWTH))[0]
    speed = 1.0
    handles = [(*point(theta), speed)]
    for link in LINKS:
        front = point(theta)
        guess = theta + link / (GROWTH * theta)
        rear = fsolve(lambda angle: np.sum((point(angle[0]) - front) ** 2) - link**2, guess, xtol=1e-12)[0]
        bench = front - point(rear)
        speed *= (tangent(theta) @ bench) / (tangent(rear) @ bench)
        theta = rear
        handles.append((*point(theta), speed))
    return np.array(handles)


def main():
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    costs = []
    for k in range(frames):
        began = time.perf_counter()
        handles = frame(300 + k / 60)
        costs.append(time.perf_counter() - began)
        if k == 0:
            print("at 300 s: head at ({:.9f}, {:.9f}), last handle at ({:.9f}, {:.9f}), its speed {:.9f}".format(
                *handles[0, :2], *handles[-1]))
    print(f"{1e3 * np.median(costs):.1f} ms a frame, the median of {frames}")


if __name__ == "__main__":
    main()
