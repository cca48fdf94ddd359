"""Compares the tables of `examples/python/contest.py` with values of 50 digits, which share no code with the program.

    contest_tables.py FOLDER EXACT.csv TURNAROUND.csv
"""

import csv
import json
import pathlib
import sys

from openpyxl import load_workbook

folder, exact, turnaround = map(pathlib.Path, sys.argv[1:])


def truth(file):
    """The handles of a table by time: number, x, y, speed."""
    times = {}
    with file.open() as lines:
        for row in csv.DictReader(lines):
            handle = (int(row["handle"]), *(float(row[name]) for name in ("x_m", "y_m", "speed_m_s")))
            times.setdefault(float(row["t_s"]), []).append(handle)
    return times


def columns(sheet):
    return {cell.value: [row[0].value for row in sheet.iter_rows(2, min_col=k, max_col=k)]
            for k, cell in enumerate(sheet[1], 1)}


def compared(file, times):
    """The greatest difference from the truth, and the numbers that were compared."""
    book = load_workbook(folder / file)
    places, speeds = columns(book["位置"]), columns(book["速度"])
    assert places[None][:2] == ["龙头x (m)", "龙头y (m)"] and places[None][-1] == "龙尾（后）y (m)", places[None][:2]
    assert len(places[None]) == 448 and len(speeds[None]) == 224, (len(places[None]), len(speeds[None]))
    greatest, count = 0.0, 0
    for time, handles in times.items():
        name = f"{time:g} s"
        for number, x, y, speed in handles if name in places else []:
            found = (places[name][2 * number], places[name][2 * number + 1], speeds[name][number])
            greatest = max(greatest, *(abs(one - other) for one, other in zip(found, (x, y, speed), strict=True)))
            count += 3
    return greatest, count


contact = max(time for time in truth(exact) if 412 < time < 413)
(sheet,) = load_workbook(folder / "result2.xlsx").worksheets
rows = list(sheet.iter_rows(2, values_only=True))
assert len(rows) == 224, len(rows)
second = max(abs(found - number) for row, handle in zip(rows, truth(exact)[contact], strict=True)
             for found, number in zip(row[1:], handle[1:], strict=True))
result = {"result1": compared("result1.xlsx", truth(exact)), "result2": second,
          "result4": compared("result4.xlsx", truth(turnaround))}
print(json.dumps(result))
