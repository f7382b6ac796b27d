"""What holds for all tests."""

from __future__ import annotations

import signal

from hypothesis import settings

# No time limit for an example: how fast a machine is belongs in benchmarks.
settings.register_profile("uav-bt", deadline=None)
settings.load_profile("uav-bt")

# A shell's background job ignores Ctrl-C, and one of `nohup` the end of its terminal; so would all
# programs that tests interrupt.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)
