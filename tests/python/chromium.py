"""Debian's Chromium, driven by Playwright: for the scripts that look at pages."""

import contextlib
import ctypes

from playwright.sync_api import sync_playwright

PROGRAM = "/usr/bin/chromium"
# linux/prctl.h, linux/capability.h
PR_CAPBSET_DROP, CAP_SYS_NICE = 24, 23


@contextlib.contextmanager
def browsers():
    """What starts a Chromium. Root's would put itself before all other processes, and those that have to be on time would not
    be: what is started from here on has no right to."""
    # Refused to whoever is not root, whose browsers have no such right anyway.
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)
    with sync_playwright() as playwright:
        yield playwright.chromium


@contextlib.contextmanager
def browser():
    """A Chromium of its own."""
    with browsers() as chromium, chromium.launch(executable_path=PROGRAM) as started:
        yield started
