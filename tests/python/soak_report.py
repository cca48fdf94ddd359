"""Reads the files of a soak test, with libraries that are independent of the program.

    soak_report.py STEM SCHEMA

Validates STEM.json against the schema. The schema must refuse the report with each of its objects' fields left out in
turn, with one more field, and with another name. Adds up the intervals of STEM.hgrm. Prints a JSON line: the fields
that were left out, and for each tag the intervals, the number of values, and percentiles.
"""

import copy
import json
import math
import sys

from hdrh.histogram import HdrHistogram
from hdrh.log import HistogramLogReader
from jsonschema import Draft202012Validator

HOUR_NS = 3_600_000_000_000


def objects(value, path=()):
    """Returns every object of a report, except those whose keys are data, with its path; of each array the first
    element."""
    if isinstance(value, dict):
        if "answers" not in path:
            yield path
        for key, inner in value.items():
            yield from objects(inner, path + (key,))
    elif isinstance(value, list) and value:
        yield from objects(value[0], path + (0,))


def at(report, path):
    for key in path:
        report = report[key]
    return report


def value_at(histogram, share):
    """Returns the value that at least this share of all values does not exceed. The library itself rounds the rank to
    the nearest."""
    rank = math.ceil(share * histogram.get_total_count())
    for step in histogram.get_recorded_iterator():
        if step.total_count_to_this_value >= rank:
            return histogram.get_highest_equivalent_value(step.value_iterated_to)


def main():
    stem, schema = sys.argv[1:]
    with open(schema) as file:
        schema = json.load(file)
    with open(f"{stem}.json") as file:
        report = json.load(file)
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    for error in validator.iter_errors(report):
        sys.exit(f"{error.json_path}: {error.message}")
    left_out = 0
    for path in objects(report):
        for field in at(report, path):
            if path == ("publisher",) and field in ("log", "ros2"):
                continue
            other = copy.deepcopy(report)
            del at(other, path)[field]
            if validator.is_valid(other):
                sys.exit(f"valid without {path} {field}")
            left_out += 1
        other = copy.deepcopy(report)
        at(other, path)["surplus"] = 1
        if validator.is_valid(other):
            sys.exit(f"valid with more in {path}")
    if validator.is_valid(report | {"schema": "bench_dragon/soak/2"}):
        sys.exit("valid by another name")

    tags = {}
    reader = HistogramLogReader(f"{stem}.hgrm", HdrHistogram(1, HOUR_NS, 3))
    while (interval := reader.get_next_interval_histogram()) is not None:
        total, intervals = tags.setdefault(interval.get_tag(), (HdrHistogram(1, HOUR_NS, 3), []))
        total.add(interval)
        intervals.append(interval.get_start_time_stamp())
    line = {"left_out": left_out, "began_at": reader.get_start_time_sec()}
    for tag, (total, intervals) in tags.items():
        line[tag] = {name: value_at(total, share) for name, share in [("p50", 0.5), ("p99", 0.99), ("p999", 0.999)]}
        line[tag] |= {"max": total.get_max_value(), "count": total.get_total_count(), "intervals": intervals}
    print(json.dumps(line))


if __name__ == "__main__":
    main()
