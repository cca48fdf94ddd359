"""Answers the five questions of problem A of the 2024 CUMCM contest, and writes its three tables.

    pip install openpyxl==3.1.5
    BENCH_DRAGON_PROGRAM=target/release/bench-dragon python3 examples/python/contest.py [--folder .]

The tables are result1.xlsx, result2.xlsx and result4.xlsx in the contest's layout, six decimals. Question 4 counts its
time from the beginning of the turn. `docs/contest.md` compares the answers with published ones.
"""

import argparse
import math
import pathlib

from bench_dragon import ask
from openpyxl import Workbook

CONFIG = pathlib.Path(__file__).resolve().parents[2] / "config"
# The turn of question 4. In this scene the head has 100 m before it, at 1 m/s.
TURNAROUND = CONFIG / "turnaround.toml"
BEFORE_THE_TURN = 100


def names(benches):
    """The contest's names of the handles."""
    return ["龙头", *(f"第{number}节龙身" for number in range(1, benches - 1)), "龙尾", "龙尾（后）"]


def add_sheet(book, title, times, rows):
    sheet = book.create_sheet(title)
    sheet.append([None, *(f"{time} s" for time in times)])
    for name, numbers in rows:
        sheet.append([name, *(round(number, 6) for number in numbers)])


def write_times(file, times, chains):
    """Writes a table of questions 1 and 4: the places of all handles at all times, and their speeds."""
    handles = names(len(chains[0]) - 1)
    book = Workbook()
    book.remove(book.active)
    # A handle is [x, y, heading, vx, vy, speed].
    places = (
        (f"{name}{axis} (m)", (chain[number][k] for chain in chains))
        for number, name in enumerate(handles)
        for k, axis in enumerate("xy")
    )
    add_sheet(book, "位置", times, places)
    speeds = ((f"{name} (m/s)", (chain[number][5] for chain in chains)) for number, name in enumerate(handles))
    add_sheet(book, "速度", times, speeds)
    book.save(file)


def chains_every_second(until, scene=None):
    lines = ask("solve", "--every", 1, "--until", until, scene=scene)
    return [line["handles"] for line in lines]


def question_1(folder):
    chains = chains_every_second(300)
    write_times(folder / "result1.xlsx", range(301), chains)
    head = chains[300][0]
    return f"at 300 s the head is at ({head[0]:.6f}, {head[1]:.6f}) m; result1.xlsx has all handles from 0 to 300 s"


def question_2(folder):
    contact = next(event for event in ask("events") if event["event"] == "contact")
    (line,) = ask("solve", "--at", "contact")
    book = Workbook()
    sheet = book.active
    sheet.title = "Sheet1"
    sheet.append([None, "横坐标x (m)", "纵坐标y (m)", "速度 (m/s)"])
    for name, handle in zip(names(len(line["handles"]) - 1), line["handles"], strict=True):
        sheet.append([name, *(round(handle[k], 6) for k in (0, 1, 5))])
    book.save(folder / "result2.xlsx")
    benches = f"benches {contact['bench_a'] + 1} and {contact['bench_b'] + 1}"
    return f"{benches} touch at {contact['time']:.9f} s; result2.xlsx has that moment"


def question_3():
    (plan,) = ask("plan", "pitch", "--reach-radius", 4.5)
    return f"the least pitch is between {plan['value_lo']:.12f} and {plan['value_hi']:.12f} m ({plan['status']})"


def question_4(folder):
    chains = chains_every_second(2 * BEFORE_THE_TURN, TURNAROUND)
    write_times(folder / "result4.xlsx", range(-BEFORE_THE_TURN, BEFORE_THE_TURN + 1), chains)
    # Two arcs of radii R1 + R2 = sqrt(R^2 + b^2), each over an angle of 2 atan(R / b), with b = pitch / 2 pi.
    radius, b = 4.5, 1.7 / math.tau
    length = 2 * math.hypot(radius, b) * math.atan(radius / b)
    (plan,) = ask("plan", "turn", "--arc-ratio", 2, scene=TURNAROUND)
    return (
        f"the S is {length:.9f} m long whatever the ratio of its arcs; with 2 : 1 it may begin at a radius of "
        f"{plan['value']:.8f} m and is {plan['length']:.8f} m then; result4.xlsx has all handles from -100 to 100 s"
    )


def question_5():
    (plan,) = ask("plan", "speed", "--max-handle-speed", 2, scene=TURNAROUND)
    return (
        f"the head may go at {plan['value_lo']:.12f} m/s; handle {plan['handle']} (the head's front is handle 0) is "
        f"the fastest, when the head is {plan['time'] - BEFORE_THE_TURN:.3f} m past the beginning of the turn"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path(), help="the folder of the tables")
    folder = parser.parse_args().folder
    answers = (
        lambda: question_1(folder),
        lambda: question_2(folder),
        question_3,
        lambda: question_4(folder),
        question_5,
    )
    for number, answer in enumerate(answers, 1):
        print(f"question {number}: {answer()}", flush=True)


if __name__ == "__main__":
    main()
