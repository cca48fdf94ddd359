"""The monitor in a terminal: `watch` in a pseudo-terminal, its output interpreted by the terminal emulator pyte.

    watch_terminal.py SCENARIO PROGRAM NAME

Starts a publisher under the service name NAME. Ends with exit code 0, or with a sentence on the error.
"""

import contextlib
import fcntl
import os
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time

import pyte

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550
ROWS = 24
# An alert a second, so that lines scroll up above the figures while the figures are redrawn.
PUBLISHER = ["run", "--quiet", "--json", "--start", "405", "--time-scale", "0.5", "--rate", "50"]
NUMBER = r"-?\d+\.\d+"
FIGURES = [
    rf"t +{NUMBER} s  tick \d+  approaching  contact in {NUMBER} s",
    rf"rate {NUMBER} Hz  received \d+  missed \d+",
    rf"latency (p50 {NUMBER} p99 {NUMBER} max {NUMBER} us|no frames)",
    rf"head \({NUMBER}, {NUMBER}\) m  224 handles  clearance {NUMBER} m",
    r"publisher: scene paper  overruns \d+  skipped \d+",
    rf"lateness p99 {NUMBER} us  step p99 {NUMBER} us  memory {NUMBER} MB",
]
ALERT = (
    rf" {{0,9}}{NUMBER} s  approaching contact: bench 1 \(the head\) and bench 9 at \(1\.474, 2\.111\) m in {NUMBER} s; "
    rf"nearest now are bench \d+( \(the head\))? and bench \d+, {NUMBER} m apart \(counting from 1\)"
)
# The words of an alert begin after its time, on each of its rows.
INDENT = " " * 14
COLOUR = re.compile(rb"\x1b\[[0-9;:]*m")

_, SCENARIO, PROGRAM, NAME = sys.argv
SILENT = f'The publisher of "{NAME}" is running but sends nothing.'


@contextlib.contextmanager
def publisher():
    child = subprocess.Popen([PROGRAM, "--name", NAME, *PUBLISHER], stdout=subprocess.DEVNULL)
    try:
        yield child
    finally:
        child.kill()
        child.wait()


class Terminal:
    """A terminal of some columns in which the monitor runs."""

    def __init__(self, columns, rows=ROWS, **environment):
        self.columns = columns
        self.screen = pyte.HistoryScreen(columns, ROWS, history=1000)
        self.stream = pyte.ByteStream(self.screen)
        self.output = b""
        self.master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        inherited = {name: value for name, value in os.environ.items() if name != "NO_COLOR"}
        self.child = subprocess.Popen(
            [PROGRAM, "--name", NAME, "watch"],
            stdin=slave, stdout=slave, stderr=slave,
            env=inherited | {"TERM": "xterm-256color"} | environment,
        )
        os.close(slave)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.child.kill()
        self.child.wait()
        os.close(self.master)

    def read(self, seconds):
        """Shows the output of the next `seconds`."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and select.select([self.master], [], [], left)[0]:
            printed = os.read(self.master, 65536)
            self.output += printed
            self.stream.feed(printed)

    def read_until(self, condition):
        self.read_until_quiet()
        while not condition(self.rows()):
            assert self.child.poll() is None, "the monitor has ended"
            self.read_until_quiet()

    def read_until_quiet(self):
        """Shows the output until there has been none for a while."""
        before = None
        while before != len(self.output):
            before = len(self.output)
            self.read(0.1)

    def rows(self):
        """Returns the rows down to the cursor, including those that have scrolled out of the top."""
        shown = [row.rstrip() for row in self.screen.display]
        assert not any(shown[self.screen.cursor.y :]), "text follows the cursor:\n" + "\n".join(shown)
        scrolled = ["".join(row[column].data for column in range(self.columns)) for row in self.screen.history.top]
        return [row.rstrip() for row in scrolled] + shown[: self.screen.cursor.y]

    def lines(self):
        """Returns the rows; the indented rows that continue an alert are joined to it.

        On a busy machine the publisher may be late by seconds, and the monitor reports that."""
        lines = []
        for row in self.rows():
            if row.startswith(INDENT):
                lines[-1] += " " + row[len(INDENT) :]
            else:
                lines.append(row)
        return [line for line in lines if line != SILENT]


def assert_matches(lines, patterns):
    shown = "\n".join(lines)
    assert len(lines) == len(patterns), f"{len(patterns)} lines are expected:\n{shown}"
    for line, pattern in zip(lines, patterns):
        assert re.fullmatch(pattern, line), f"{line!r} is not {pattern!r}:\n{shown}"


def is_publishing(rows):
    return len(rows) >= len(FIGURES) and rows[-1].startswith("lateness")


def is_waiting(rows):
    return any(row.startswith("waiting for a publisher") for row in rows)


def figures_are_redrawn_in_place():
    started = [rf'Watching "{NAME}"; Ctrl-C ends, \? lists the keys\.', rf'A publisher of "{NAME}" is running \(run [0-9a-f]{{16}}\)\.']
    # The wide one knows its columns only, as a serial line does.
    with Terminal(80) as terminal, Terminal(200, rows=0) as wide, Terminal(60) as narrow, Terminal(50) as narrowest:
        every = [terminal, wide, narrow, narrowest]
        for each in every:
            each.read_until(is_waiting)
        with publisher() as running:
            for each in every:
                each.read_until(is_publishing)
            # However much has been redrawn by then, the terminal shows nothing else, until several seconds of alerts
            # have come.
            alerts = []
            while len(alerts) < 6:
                for each in every:
                    each.read_until_quiet()
                for each in [terminal, wide]:
                    lines = each.lines()
                    alerts = lines[len(started) : -len(FIGURES)]
                    assert_matches(lines, started + [ALERT] * len(alerts) + FIGURES)
            # Wide enough for a whole alert.
            assert any(re.fullmatch(ALERT, row) for row in wide.rows()), "\n".join(wide.rows())
            print("\n".join(terminal.rows()))
            # If the terminal is narrower, a figure's line is cut and still takes one row.
            for each in [narrow, narrowest]:
                rows = each.rows()
                assert [row[:4] for row in rows[-6:]] == ["t   ", "rate", "late", "head", "publ", "late"], "\n".join(rows)
                for begin in ["rate ", "head (", "publisher: "]:
                    assert sum(row.startswith(begin) for row in rows) == 1, "\n".join(rows)
            running.send_signal(signal.SIGKILL)
            ended = [rf'The publisher of "{NAME}" has ended; waiting for the next\.', rf'waiting for a publisher of "{NAME}"', r'(no show runs|running) here: .+']
            terminal.read_until(is_waiting)
            lines = terminal.lines()
            alerts = lines[len(started) : -len(ended)]
            assert_matches(lines, started + [ALERT] * len(alerts) + ended)


def colour_follows_no_color():
    with publisher(), Terminal(80) as coloured, Terminal(80, NO_COLOR="1") as plain:
        for each in [coloured, plain]:
            each.read_until(lambda rows: is_publishing(rows) and any("approaching" in row for row in rows[:-6]))
        assert COLOUR.search(coloured.output), coloured.output
        assert not COLOUR.search(plain.output), plain.output
        # Only the colours differ: both redraw in place.
        assert b"\x1b[" in plain.output, plain.output
        piped = subprocess.run([PROGRAM, "--name", NAME, "watch", "--duration", "2"], capture_output=True, check=True)
        assert b"rate " in piped.stdout and b"\x1b" not in piped.stdout + piped.stderr, piped


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [figures_are_redrawn_in_place, colour_follows_no_color]}[SCENARIO]()
