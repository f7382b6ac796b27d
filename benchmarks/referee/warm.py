"""Run command lines of one program, each in a fork of a process that has its modules loaded."""

import gc
import io
import json
import multiprocessing
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout


def call(words: list[str]) -> tuple[int, str]:
    """Run `python -m uav_bt` with these words; return its exit code and output."""
    sys.argv, out = ["uav_bt", *words], io.StringIO()
    with redirect_stdout(out), redirect_stderr(io.StringIO()):
        try:
            runpy.run_module("uav_bt", run_name="__main__", alter_sys=True)
        except SystemExit as end:
            return int(end.code or 0), out.getvalue()
    return 0, out.getvalue()


fork = multiprocessing.get_context("fork").Process
lines = json.load(sys.stdin)
for first in {line[0]: line for line in lines[::-1]}.values():
    call(first)  # loads the modules
gc.freeze()  # a collection would copy all memory in each fork
ends = []
for line in lines:
    reader, writer = multiprocessing.Pipe(duplex=False)
    process = fork(target=lambda: writer.send(call(line)))  # noqa: B023
    process.start()
    writer.close()
    try:
        ends.append(reader.recv())
    except EOFError:
        ends.append((1, "raised"))
    process.join()
json.dump(ends, sys.stdout)
