"""Runs scenarios of the scripts beside it, one after the other, in one Chromium: to start one takes longer than most
scenarios compute.

    scenarios.py

Reads a JSON line for each scenario: the script and its arguments. Prints a JSON line at its end: what it `printed`, and
its `failure`, or null. Ends after a failure, whose browser may not be usable, and with its input.
"""

import contextlib
import io
import json
import pathlib
import runpy
import signal
import sys
import traceback

import chromium  # noqa: F401, the scripts' own, which keeps the browser

HERE = pathlib.Path(__file__).resolve().parent


def run(script, *arguments):
    """Returns the output of a script, and its failure or None."""
    # A script reads its arguments when it is loaded, and so do those that it imports.
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and pathlib.Path(file).parent == HERE and name not in ("__main__", "chromium"):
            del sys.modules[name]
    sys.argv = [script, *arguments]
    printed, failure = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        try:
            runpy.run_path(str(HERE / script), run_name="__main__")
        except BaseException:  # A watchdog ends the script, too.
            failure = traceback.format_exc()
        signal.alarm(0)
    return printed.getvalue(), failure


for line in sys.stdin:
    printed, failure = run(*json.loads(line))
    print(json.dumps({"printed": printed, "failure": failure}), flush=True)
    if failure:
        sys.exit(1)
