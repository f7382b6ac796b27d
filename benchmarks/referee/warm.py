"""Run command lines of one program, each in a fork of a process that has its modules loaded."""

import contextlib
import gc
import io
import json
import multiprocessing
import runpy
import sys


def call(words: list[str]) -> tuple[int, str, str]:
    """Run `python -m uav_bt` with these words; return its exit code, output and errors."""
    sys.argv, code, out, errors = ["uav_bt", *words], 0, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            runpy.run_module("uav_bt", run_name="__main__", alter_sys=True)
        except SystemExit as end:
            code = int(end.code or 0)
    return code, out.getvalue(), errors.getvalue()


lines = json.load(sys.stdin)
for first in {line[0]: line for line in lines[::-1]}.values():
    call(first)  # loads the modules
gc.freeze()  # a collection would copy all memory in each fork
with multiprocessing.get_context("fork").Pool(1, maxtasksperchild=1) as pool:
    json.dump(pool.map(call, lines, chunksize=1), sys.stdout)
