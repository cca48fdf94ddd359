#!/usr/bin/env python3
"""The contest problem behind the paper's scene, as it is usually solved: SciPy, handle by handle, step by step.

Problem A of the 2024 China Undergraduate Mathematical Contest in Modeling. SciPy's brentq finds the head's polar angle
from the arc length. It finds each follower as the next place outward at the distance of its link; --method fsolve uses
fsolve for this. The contact is the first tested time at which the rectangles of two benches overlap. The test is the
separating axis theorem, for all pairs near enough at once, in NumPy. With --refine, the contact is the root of the
least gap between this time and the time before. Speeds are left out. Prints the largest error of the positions at 300 s
against the figures of 50 digits in tests/truth, the contact's error, and the time needed. Needs: pip install numpy
scipy

    python3 benches/peers/scipy_contest.py [--method brentq|fsolve] [--step 1] [--start 0] [--refine]
"""

import argparse
import csv
import os
import time

import numpy as np
from scipy.optimize import brentq, fsolve

TRUTH = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "tests", "truth", "paper_scene_exact.csv")
GROWTH = 0.55 / (2 * np.pi)
START = 32 * np.pi
LINKS = np.array([2.86] + 222 * [1.65])
INSET, WIDTH = 0.275, 0.3
# Two boards whose middles are farther apart than their half diagonals together cannot touch.
REACH = np.hypot(LINKS / 2 + INSET, WIDTH / 2)
PAIRS = np.array(np.triu_indices(len(LINKS), 2))


def arc_length(theta):
    return 0.5 * GROWTH * (theta * np.sqrt(1 + theta * theta) + np.arcsinh(theta))


def head(seconds):
    return brentq(lambda theta: arc_length(START) - arc_length(theta) - seconds, 0, START, xtol=1e-14, rtol=1e-15)


def excess(rear, front, link):
    """Returns the square of the distance of two places on the spiral, less the square of the link."""
    return GROWTH**2 * (front * front + rear * rear - 2 * front * rear * np.cos(rear - front)) - link * link


def by_brentq(front, link):
    # Half a turn on, the distance is more than the link wherever the motion can continue.
    return brentq(excess, front, front + np.pi, args=(front, link), xtol=1e-14, rtol=1e-15)


def by_fsolve(front, link):
    return fsolve(excess, front + link / (GROWTH * front), args=(front, link))[0]


def handles(seconds, follower):
    theta = [head(seconds)]
    for link in LINKS:
        theta.append(follower(theta[-1], link))
    theta = np.array(theta)
    return GROWTH * theta[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)


def gaps(points):
    """Returns the gap of every pair of benches that share no handle and are near enough: negative if they overlap."""
    front, rear = points[:-1], points[1:]
    centre, along = (front + rear) / 2, (front - rear) / LINKS[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    a, b = PAIRS
    between = centre[b] - centre[a]
    near = np.hypot(*between.T) < REACH[a] + REACH[b]
    a, b, between = a[near], b[near], between[near]
    half = LINKS / 2 + INSET
    gap = np.full(len(a), -np.inf)
    for axis in (along[a], across[a], along[b], across[b]):
        shadow = np.abs(np.sum(axis * between, axis=1))
        for bench in (a, b):
            shadow -= half[bench] * np.abs(np.sum(axis * along[bench], axis=1))
            shadow -= WIDTH / 2 * np.abs(np.sum(axis * across[bench], axis=1))
        gap = np.maximum(gap, shadow)
    least = np.argmin(gap)
    return gap[least], (int(a[least]), int(b[least]))


def contact(step, start, refine, follower):
    number = 0
    while True:
        number += 1
        seconds = start + number * step
        gap, pair = gaps(handles(seconds, follower))
        if gap <= 0:
            break
    if refine:
        seconds = brentq(lambda t: gaps(handles(t, follower))[0], seconds - step, seconds, xtol=1e-13, rtol=1e-15)
    return seconds, pair, number


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", choices=["brentq", "fsolve"], default="brentq")
    parser.add_argument("--step", type=float, default=1)
    parser.add_argument("--start", type=float, default=0)
    parser.add_argument("--refine", action="store_true")
    arguments = parser.parse_args()
    follower = {"brentq": by_brentq, "fsolve": by_fsolve}[arguments.method]
    with open(TRUTH) as file:
        rows = list(csv.DictReader(file))
    exact = np.array([[float(row["x_m"]), float(row["y_m"])] for row in rows if row["t_s"] == "300.0"])
    # The only time in the table that is not a round number.
    touch = next(float(row["t_s"]) for row in rows if row["t_s"].startswith("412."))
    points = handles(300, follower)
    error = np.max(np.hypot(*(points - exact).T))
    began = time.perf_counter()
    found, pair, looked = contact(arguments.step, arguments.start, arguments.refine, follower)
    took = time.perf_counter() - began
    print(f"{arguments.method}, 300 s: {error:.1e} m off at most")
    print(f"contact: {found:.12f} s, {found - touch:+.1e} s, benches {pair[0]} and {pair[1]}")
    print(f"{looked} times looked at, {took:.1f} s, {1e3 * took / looked:.0f} ms each")


if __name__ == "__main__":
    main()
