"""Settings every Python test shares."""

import signal

import matplotlib
import pytest
from hypothesis import settings

# No display is needed, and a slow machine is no failure. The quick tier draws the same examples every time;
# ./tools/test --full draws fresh ones, and more.
matplotlib.use("Agg")
settings.register_profile("quick", deadline=None, derandomize=True)
settings.register_profile("full", deadline=None, max_examples=300, print_blob=True)
settings.load_profile("quick")

# The helpers of the tests with real processes hold fixtures and assertions.
pytest.register_assert_rewrite("command", "two_processes", "reference.logged_run")

# A shell starts what runs in its background deaf to Ctrl-C, nohup to a hangup, and so are then the processes of the
# tests about both. A handler, unlike deafness, is not inherited: this process goes on ignoring hangups.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda *_: None)
