"""Settings of all tests."""

from __future__ import annotations

import signal

from hypothesis import settings

# Examples have no time limit: only benchmarks measure speed.
settings.register_profile("uav-bt", deadline=None)
settings.load_profile("uav-bt")

# A background job of a shell ignores Ctrl-C, and `nohup` ignores the end of the terminal. Child
# processes inherit this, but tests interrupt them.
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)
