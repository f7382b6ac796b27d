#!/bin/sh
# Puts uav-bt into a virtual environment: tools/install.sh VENV [EXTRAS]
#
# Takes PYTHON if that is set, or else the newest Python that the tests run on. Works without
# Debian's python3-venv package as long as there is a pip. Needs no compiler, no root and no GPU.
set -u

venv=$1
extras=${2:-}
log=$venv/install.log

say() { printf '%s\n' "$*" >&2; }
die() { say "make: $*"; exit 2; }

recent() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        recent "$PYTHON" || die "PYTHON=$PYTHON is no Python 3.11 or later"
        python=$PYTHON
        return
    fi
    for python in python3.13 python3.12 python3.11 python3; do
        recent "$python" && return
    done
    found=$(python3 --version 2>/dev/null || echo none)
    die "needs Python 3.11 or later, found: $found. Install one (Debian, Ubuntu:" \
        "apt install python3 python3-venv python3-pip) or name one: make PYTHON=/path/to/python3"
}

# What pip has against it, in short; the log has the rest.
complain() {
    grep -h -i -E '^ *(error|fatal)' "$log" | sort -u | tail -n 5 >&2
    say "(all of it is in $log)"
}

# Run pip; its output goes to the log, and a line for each package to the terminal.
pip_install() {
    {
        "$venv/bin/python" -m pip --disable-pip-version-check install --progress-bar off "$@" 2>&1
        echo $? >"$venv/install.status"
    } | tee -a "$log" | sed -n \
        -e 's/^ *Downloading \(.*\/\)*\([^-]*-[^-]*\)-.*\.whl (\(.*\)).*/  \2, \3/p' \
        -e 's/^ *Using cached \(.*\/\)*\([^-]*-[^-]*\)-.*\.whl (\(.*\)).*/  \2, \3 (from the cache)/p' \
        -e 's/^Installing collected packages.*/  unpacking/p' >&2
    if [ "$(cat "$venv/install.status")" = 0 ]; then
        return
    fi
    complain
    die "packages could not be installed (above: what pip says). Is the network, or the package" \
        "index that pip is set up for, within reach? The same command again goes on from here"
}

make_venv() {
    find_python
    say "making $venv with $("$python" --version)"
    rm -rf "$venv"
    if "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        "$python" -m venv "$venv" >/dev/null 2>&1 && return
    fi
    # Debian keeps ensurepip in a package of its own; a pip that is there can do its work.
    "$python" -c 'import venv' 2>/dev/null ||
        die "$python has no venv module; install it (Debian, Ubuntu: apt install python3-venv)"
    "$python" -m pip --version >/dev/null 2>&1 ||
        die "$python has neither ensurepip nor pip; install one" \
            "(Debian, Ubuntu: apt install python3-venv, or python3-pip)"
    rm -rf "$venv"
    "$python" -m venv --without-pip "$venv" || die "$python cannot make $venv"
    if ! "$python" -m pip --python "$venv/bin/python" --disable-pip-version-check \
        install --quiet pip >"$log" 2>&1; then
        complain
        die "pip could not be put into $venv (above: what it says)." \
            "Is the network within reach? Or install python3-venv (Debian, Ubuntu)"
    fi
}

# Open a context and close it again: a library that is there need not work.
draws() {
    "$venv/bin/python" -c '
from sim_bridge.twin.gl import open_context
context = open_context(64, 64)
context.make_current()
context.free()' >>"$log" 2>&1
}

[ -x "$venv/bin/python" ] && recent "$venv/bin/python" &&
    "$venv/bin/python" -m pip --version >/dev/null 2>&1 || make_venv
: >"$log"

say "installing uav-bt${extras:+ with $extras} into $venv (the first time takes some minutes)"
pip_install -c constraints.txt -e ".${extras:+[$extras]}"

# EGL, where the machine has it, needs no package; the wheel with a software OpenGL is 84 MB. Its
# own requirements are a graphics library that nothing here uses.
if ! draws; then
    say "no EGL here: installing a software OpenGL"
    pip_install -c constraints.txt --no-deps lavavu-osmesa
    draws || { tail -n 1 "$log" >&2; die "there is no OpenGL that works (all is in $log)"; }
fi

say "compiling"
"$venv/bin/python" -m uav_bt.compiled >>"$log" 2>&1 || { complain; die "the compilation failed"; }
