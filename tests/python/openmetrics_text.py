"""Reads OpenMetrics text from standard input with prometheus-client of PyPI; prints its samples as one JSON object."""

import json
import sys

from prometheus_client.openmetrics.parser import text_string_to_metric_families

families = list(text_string_to_metric_families(sys.stdin.read()))
samples = {
    sample.name + "".join(f",{label}={value}" for label, value in sorted(sample.labels.items()) if label != "name"): float(
        sample.value
    )
    for family in families
    for sample in family.samples
}
names = {sample.labels["name"] for family in families for sample in family.samples}
assert len(names) == 1 and all(family.documentation for family in families)
print(json.dumps(samples))
