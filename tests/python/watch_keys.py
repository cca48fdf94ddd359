"""The keys of `watch`: in a pseudo-terminal, with a publisher that executes their commands.

    watch_keys.py SCENARIO PROGRAM NAME SCENE

Starts a publisher of SCENE under the service name NAME, and reads its state with `control state`. Ends with exit code
0, or with a sentence on the error.
"""

import contextlib
import fcntl
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import threading
import time

from show_process import ShowProcess

# No wait here may last forever; an alarm still ends everything that was started.
WATCHDOG = 550
LEFT, RIGHT = "\x1b[D", "\x1b[C"

_, SCENARIO, PROGRAM, NAME, SCENE = sys.argv
SHOW = ShowProcess(PROGRAM, NAME)
state, until = SHOW.state, SHOW.until


@contextlib.contextmanager
def publisher(*arguments):
    command = [PROGRAM, "--name", NAME, "--scene", SCENE, "run", "--quiet", "--json", "--rate", "50", *arguments]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        until(lambda: state(), "a publisher")
        yield child
    finally:
        child.kill()
        child.wait()


class Watch:
    """The monitor in a separate terminal, in its foreground."""

    def __init__(self):
        self.output = b""
        self.child, self.master = pty.fork()
        if self.child == 0:
            os.execv(PROGRAM, [PROGRAM, "--name", NAME, "watch"])
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        # A terminal whose output is not read blocks the processes that write to it.
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        self.shows("? lists the keys")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.child is not None:
            os.kill(self.child, signal.SIGKILL)
            os.waitpid(self.child, 0)
        self.reader.join()
        os.close(self.master)

    def read(self):
        # At its end a terminal returns an error instead of output.
        with contextlib.suppress(OSError):
            while printed := os.read(self.master, 65536):
                self.output += printed

    def shows(self, words):
        # A sentence may be broken into rows.
        shown = lambda: words in " ".join(self.output.decode(errors="replace").split())
        until(shown, words)

    def press(self, keys):
        os.write(self.master, keys.encode())

    def local_flags(self):
        return termios.tcgetattr(self.master)[3]

    def reads_keys(self):
        return not self.local_flags() & (termios.ICANON | termios.ECHO)

    def exit_code(self):
        _, status = os.waitpid(self.child, 0)
        self.child = None
        return os.waitstatus_to_exitcode(status)


def keys_conduct():
    with publisher("--start", "100", "--paused") as _, Watch() as watch:
        watch.shows("(paused)")
        assert state()["playback"] == "paused", "nothing is sent without a key"
        watch.press("?")
        watch.shows("Keys: space pauses and resumes")
        # The start waits: space continues from there too.
        watch.press(" ")
        until(lambda: state()["playback"] == "playing", "space resumes")
        # The rate is the rate of the frames.
        until(lambda: state()["sim_time"] > 101, "the show plays")
        watch.press("]]")
        until(lambda: state()["time_scale"] == 4.0, "] twice makes 4 of 1")
        watch.press("[[[")
        until(lambda: state()["time_scale"] == 0.5, "[ three times makes 0.5 of 4")
        watch.press(" ")
        before = until(lambda: state() if state()["playback"] == "paused" else None, "space pauses")
        watch.press(RIGHT * 3 + LEFT)
        moved = lambda: abs(state()["sim_time"] - before["sim_time"] - 10) < 1e-9
        until(moved, "right three times and left once are 10 s")
        watch.press("..")
        # Two periods of 1/50 s at a rate of 0.5.
        until(lambda: abs(state()["sim_time"] - before["sim_time"] - 10.02) < 1e-9, "two steps")
        assert state()["playback"] == "paused"
        watch.press("h")
        until(lambda: state()["playback"] == "held", "h holds")
        watch.press(" ")
        watch.shows("resume is refused: the show is held")
        watch.press("r")
        until(lambda: state()["playback"] == "paused", "r releases")
        # Escape by hand does not begin a sequence: the two keys after it count.
        watch.press("\x1b")
        time.sleep(0.5)
        watch.press("[")
        time.sleep(0.5)
        watch.press("h")
        until(lambda: state()["playback"] == "held", "h after Escape and [ holds")
        watch.press("r")
        until(lambda: state()["playback"] == "paused", "r releases")
        # Seeks stay within the show.
        before = state()["sim_time"]
        watch.press(LEFT * 16)
        until(lambda: abs(state()["sim_time"] - before + 80) < 1e-9, "seeks to the left")
        watch.press(LEFT * (int(before - 80) // 5 + 4))
        until(lambda: state()["sim_time"] == 0, "no seek before the start")
        assert watch.reads_keys()
        watch.press("q")
        assert watch.exit_code() == 0
        assert not watch.reads_keys(), "the terminal is as before"


def terminal_is_restored():
    # No publisher runs: a command prints one sentence, and every exit restores the terminal.
    with Watch() as watch:
        until(watch.reads_keys, "keys are read")
        watch.press("h")
        watch.shows("no publisher has the name")
        watch.press("\x03")
        assert watch.exit_code() == 0, "Ctrl-C ends it"
        assert not watch.reads_keys()
    for sent in [signal.SIGTERM, signal.SIGQUIT, signal.SIGBUS]:
        with Watch() as watch:
            until(watch.reads_keys, "keys are read")
            os.kill(watch.child, sent)
            assert watch.exit_code() == (1 if sent == signal.SIGBUS else 0), sent
            assert not watch.reads_keys(), f"{sent} leaves the terminal without an echo"
    with Watch() as watch:
        until(watch.reads_keys, "keys are read")
        watch.press("\x1a")
        # Its session has no shell: its parent sees the stop, as a shell would.
        done, status = os.waitpid(watch.child, os.WUNTRACED)
        assert done and os.WIFSTOPPED(status), "Ctrl-Z stops it"
        assert not watch.reads_keys(), "a stopped program leaves the terminal as it was"
        os.kill(watch.child, signal.SIGCONT)
        until(watch.reads_keys, "keys are read again")
        watch.press("q")
        assert watch.exit_code() == 0
    for arguments in [["--json", "watch"], ["watch"]]:
        # In a pipe: the terminal stays as it is, and its keys are not read.
        master, slave = os.openpty()
        before = termios.tcgetattr(slave)
        command = [PROGRAM, "--name", NAME, *arguments]
        piped = subprocess.Popen(command, stdin=slave, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        os.write(master, b"q")
        assert piped.stdout.readline(), "a report"
        assert piped.poll() is None and termios.tcgetattr(slave) == before, arguments
        piped.kill()
        piped.wait()
        os.close(master)
        os.close(slave)


def foreground_later():
    # A shell starts the monitor in the background, while the shell owns the terminal's keys. The command fg brings it
    # to the front, and sends no signal to a running program.
    with publisher("--start", "100", "--paused"):
        child, master = pty.fork()
        if child == 0:
            os.execvp("bash", ["bash", "--norc", "--noprofile", "-i"])
        output = []

        def read():
            with contextlib.suppress(OSError):
                while printed := os.read(master, 65536):
                    output.append(printed)

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        shown = lambda words: lambda: words in b"".join(output).decode(errors="replace")
        os.write(master, f"{PROGRAM} --name {NAME} watch &\n".encode())
        until(shown("(paused)"), "the monitor's line")
        os.write(master, b"fg\n")
        until(lambda: not termios.tcgetattr(master)[3] & termios.ICANON, "keys are read in the foreground")
        os.write(master, b"h")
        until(lambda: state()["playback"] == "held", "h holds")
        os.write(master, b"q")

        def ended():
            # The monitor may have read the line instead.
            os.write(master, b"exit\n")
            time.sleep(0.2)
            return os.waitpid(child, os.WNOHANG)[0]

        until(ended, "the shell ends")


signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"{SCENARIO} did not end within {WATCHDOG} s"))
signal.alarm(WATCHDOG)
{scenario.__name__: scenario for scenario in [keys_conduct, terminal_is_restored, foreground_later]}[SCENARIO]()
