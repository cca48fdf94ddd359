"""Debian's Chromium, driven by Playwright, for the scripts that test pages."""

import contextlib
import ctypes

from playwright.sync_api import sync_playwright

PROGRAM = "/usr/bin/chromium"
# linux/prctl.h, linux/capability.h
PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


@contextlib.contextmanager
def browsers():
    """Returns an object that starts a Chromium. As root, Chromium would raise its priority above all other processes,
    which would then miss their deadlines; processes started from here on have no right to that."""
    # Refused to users other than root, whose browsers have no such right anyway.
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)
    with sync_playwright() as playwright:
        yield playwright.chromium


@contextlib.contextmanager
def browser():
    """A separate Chromium."""
    with browsers() as chromium, chromium.launch(executable_path=PROGRAM) as started:
        yield started
