"""Run command lines of one program, each in a fork of a process that has its modules loaded."""

import contextlib
import gc
import io
import json
import os
import runpy
import sys
import traceback


def call(words: list[str]) -> int:
    """Run `python -m uav_bt` with these words in this process; return its exit code."""
    sys.argv = ["uav_bt", *words]
    try:
        runpy.run_module("uav_bt", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return int(end.code or 0)
    except Exception:  # noqa: BLE001  # a program's crash is its answer
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    sys.path.pop(0)  # the referee's folder
    folder, lines, nowhere = sys.argv[1], json.load(sys.stdin), io.StringIO()
    with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        for first in {line[0]: line for line in lines[::-1]}.values():
            call(first)  # loads the modules
    gc.collect()
    gc.freeze()  # a collection would copy all memory in each fork
    for number, line in enumerate(lines):
        if not (child := os.fork()):
            for stream in (1, 2):
                os.dup2(os.open(f"{folder}/{number}.{stream}", os.O_CREAT | os.O_WRONLY), stream)
            code = call(line)
            sys.stdout.flush()
            os._exit(code)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
