"""`uav-bt` itself: its groups and commands, and how errors become one line and an exit code.

Exit codes: 0 good; 1 a mission or comparison failed or was interrupted; 2 the input was refused or
the usage was wrong.
"""

from __future__ import annotations

import errno
import importlib
import os
import sys
import traceback
from collections.abc import Mapping
from typing import Any, Final

import click
from click.shell_completion import CompletionItem

import uav_bt as package
from uav_bt.cli.interrupts import stopped_by
from uav_bt.errors import UavBtError, did_you_mean
from uav_bt.plugins import check_packages, missing_extra

_OF_DISKS: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
# Module and function in `uav_bt/cli` by the words of the command, with its line of the help. They
# stand here because a module is imported when its command runs or its help is requested.
COMMANDS: Final = {
    "fly": ("fly:fly", "Fly a mission."),
    "check": ("check:check", "Check tree files and report all that is wrong."),
    "new": ("check:new", "Write a commented mission file to begin with."),
    "simulate": ("tree:simulate", "Tick a tree with scripted leaves."),
    "campaign": ("campaign:campaign", "Fly missions many times."),
    "report": ("campaign:report", "Write the report of campaigns."),
    "shrink": ("campaign:shrink", "Reduce a failed flight to its fewest causes."),
    "view": ("record:view", "Show the record of a flight."),
    "replay": ("record:replay", "Feed a recorded flight through the tree again."),
    "lsp": ("tree:lsp", "Check and complete tree files in editors."),
    "doctor": ("doctor:doctor", "Check the installation."),
    "serve-anafi": ("serve_anafi:serve_anafi", "Serve a simulated ANAFI."),
    "tree nodes": ("tree:nodes", "List the nodes that tree files can use."),
    "tree render": ("tree:render", "Draw a tree file, with its subtrees in place."),
    "tree schema": ("tree:schema", "Write an XML Schema of tree files."),
    "record info": ("record:info", "Print the content of a record."),
    "net perceive": ("evaluate:perceive", "Run perception over a video or a camera."),
    "net collect": ("train:collect", "Fly and record for the control student."),
    "net train depth": ("train:depth", "Train the depth network on flights."),
    "net train student": ("train:student", "Train the control student on advised flights."),
    "net evaluate depth": ("evaluate:depth", "Measure metric depth."),
    "net evaluate student": ("evaluate:student", "Measure a control student by the rule."),
    "net export depth": ("train:export_depth", "Export a depth network."),
    "net export student": ("train:export_student", "Export a control student."),
    "lab new": ("lab:new", "Write a commented lab file to begin with."),
    "lab film": ("lab_images:film", "Film a lab in the twin."),
    "lab frames": ("lab_images:frames", "Take images of a lab from videos."),
    "lab pick": ("lab_images:pick", "Pick classes on the images of a lab."),
    "lab train": ("train:lab_network", "Train the segmentation network of a lab."),
    "lab check": ("lab_images:check", "Score the network of a lab on held-out picks."),
    "lab scenes": ("lab:scenes", "List the shipped scenes, or draw the map of one."),
    "lab print-mark": ("lab:print_mark", "Print the landing mark of a lab at true size."),
    "lab schema": ("lab:schema", "Write a JSON schema of lab files."),
    "lab calibrate": ("lab:calibrate", "Calibrate a camera from photographs of a checkerboard."),
    "lab tune-heading": ("lab:tune_heading", "Choose gains of the heading by a record."),
}
_GROUPS: Final = {
    "tree": "List nodes; draw tree files, write their schema.",
    "record": "Look into records of flights.",
    "net": "Train, evaluate and export networks.",
    "net train": "Train the networks that missions fly on.",
    "net evaluate": "Measure networks against the twin's truth.",
    "net export": "Make ONNX files from trained weights.",
    "lab": "Begin and train labs, calibrate, tune the heading.",
}


_LINES: Final = {words: line for words, (_, line) in COMMANDS.items()}


class LazyGroup(click.Group):
    """A group whose commands are imported when they run or when their help is requested.

    `words` are those by which it is called, with a space behind; "" for `uav-bt` itself.
    """

    def __init__(self, name: str | None = None, *, words: str = "", **attributes: Any) -> None:
        super().__init__(name, **attributes)
        self._words = words

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of commands and groups in the order of the help."""
        del ctx
        return [*self._lines({**_LINES, **_GROUPS})]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """Import a command; if there is none of that name, the message names the nearest."""
        words = f"{self._words}{cmd_name}"
        if words in _GROUPS:
            return LazyGroup(cmd_name, words=f"{words} ", help=_GROUPS[words])
        if words not in COMMANDS:
            ctx.fail(f"there is no command '{cmd_name}'{self._hint(cmd_name)}")
        module, _, attribute = COMMANDS[words][0].partition(":")
        found: click.Command = getattr(importlib.import_module(f"uav_bt.cli.{module}"), attribute)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of commands and of groups; imports nothing."""
        del ctx
        for title, table in (("Commands", _LINES), ("Groups of commands", _GROUPS)):
            if rows := self._lines(table):
                with formatter.section(title):
                    formatter.write_dl([*rows.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands, groups or options that begin so; imports no command."""
        lines = self._lines({**_LINES, **_GROUPS})
        begun = [name for name in lines if name.startswith(incomplete)]
        found = [CompletionItem(name, help=lines[name]) for name in begun]
        return found or super().shell_complete(ctx, incomplete)

    def _lines(self, table: Mapping[str, str]) -> dict[str, str]:
        """Return the lines of the help, by name, of what stands directly in this group."""
        inside = {
            words.removeprefix(self._words): line
            for words, line in table.items()
            if words.startswith(self._words)
        }
        return {name: line for name, line in inside.items() if " " not in name}

    def _hint(self, name: str) -> str:
        """Return where a command of this name is, or the nearest name."""
        known = (*_GROUPS, *COMMANDS)
        places = [f"'uav-bt {words}'" for words in known if words.rpartition(" ")[2] == name]
        if places:
            return f"; '{name}' is {' or '.join(places)}"
        here = [*self._lines({**_LINES, **_GROUPS})]
        # 'flight' is 0.44 similar to 'fly'. At that ratio most unlike names match, so the first two
        # letters must be equal.
        alike = [known for known in here if known[:2] == name[:2]]
        return did_you_mean(name, here) or did_you_mean(name, alike, cutoff=0.4)


class _Root(LazyGroup):
    """The outermost group, where every error becomes one line and an exit code."""

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run the command line of this process; `--help` and `--version` print in here."""
        try:
            return super().main(*args, **extra)
        except OSError as error:
            fault = _output_fault(error)
            if fault is None:
                raise
            click.echo(f"Error: {fault}", err=True)
            sys.exit(fault.exit_code)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; an error is printed in one line, and the exit code is its own."""
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.Abort, click.exceptions.Exit, BrokenPipeError):
            raise  # click's own; a closed pipe ends it quietly
        except KeyboardInterrupt as stop:
            click.echo(f"\nError: {stopped_by(stop)}", err=True)
            raise click.exceptions.Exit(UavBtError.exit_code) from stop
        except Exception as error:
            known = missing_extra(error) if isinstance(error, ModuleNotFoundError) else error
            known = _output_fault(error) or known
            if isinstance(known, UavBtError):
                message, code = str(known), known.exit_code
            else:
                message, code = f"unexpected {type(error).__name__}: {error}", UavBtError.exit_code
                message += "" if ctx.params["debug"] else " (`uav-bt --debug ...` shows where)"
            if ctx.params["debug"]:
                click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
            click.echo(f"Error: {message}", err=True)
            for note in getattr(error, "__notes__", ()):
                click.secho(note, fg="red", bold=True, err=True)
            raise click.exceptions.Exit(code) from error


def _output_fault(error: Exception) -> UavBtError | None:
    """Return the error for a standard output that cannot be written, such as on a full disk."""
    # A file with a name has errors that name it.
    if not isinstance(error, OSError) or error.filename or error.errno not in _OF_DISKS:
        return None
    try:
        click.echo()  # a failed write leaves no other trace in the stream
    except OSError as fault:
        # Python flushes again when it exits, and must not fail then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UavBtError(f"standard output cannot be written: {fault.strerror or fault}")
    return None


@click.group(
    cls=_Root, context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.version_option(package.__version__, prog_name="uav-bt")
@click.option("--debug", is_flag=True, help="Show where an error came from.")
def uav_bt(*, debug: bool) -> None:
    """Compose, check, fly and measure vision-only drone missions."""
    del debug  # read from the context where errors are printed
    check_packages()
