"""`uav-bt` itself: its groups and commands, and how errors become one line and an exit code.

Exit codes: 0 good; 1 a mission or comparison failed or was interrupted; 2 the input was refused or
the usage was wrong.
"""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import click
from click.shell_completion import CompletionItem

import uav_bt as package
from uav_bt.cli.interrupts import stopped_by
from uav_bt.cli.standard_output import output_fault
from uav_bt.errors import UavBtError, did_you_mean
from uav_bt.plugins import check_packages, missing_extra


class LazyGroup(click.Group):
    """A group whose commands are imported when they run or when their help is requested.

    Args:
        name: of the group.
        lazy: where each command stands (module:attribute), and its line in the group's help.
        groups: the groups inside it.
        attributes: of `click.Group`.
    """

    def __init__(
        self,
        name: str | None = None,
        *,
        lazy: Mapping[str, tuple[str, str]],
        groups: Sequence[LazyGroup] = (),
        **attributes: Any,
    ) -> None:
        super().__init__(name, {str(group.name): group for group in groups}, **attributes)
        self._lazy = lazy
        self._groups = groups

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of commands and groups in the order of the help."""
        del ctx
        return [name for (name,) in (path for path in self.paths() if len(path) == 1)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """Import a command.

        Raises:
            UsageError: There is no command of that name; the message names the group that has it.
        """
        if cmd_name in self.commands:
            return self.commands[cmd_name]
        if cmd_name not in self._lazy:
            root = ctx.find_root().command
            found = root.paths() if isinstance(root, LazyGroup) else ()
            places = [f"'uav-bt {' '.join(path)}'" for path in found if path[-1] == cmd_name]
            hint = (
                f"; '{cmd_name}' is {' or '.join(places)}"
                if places
                else _did_you_mean(cmd_name, self.list_commands(ctx))
            )
            ctx.fail(f"there is no command '{cmd_name}'{hint}")
        module, _, attribute = self._lazy[cmd_name][0].partition(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def paths(self) -> Iterator[tuple[str, ...]]:
        """Yield the words by which every command and group below this one is called."""
        for name in self._lazy:
            yield (name,)
        for group in self._groups:
            yield (str(group.name),)
            for path in group.paths():
                yield (str(group.name), *path)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections of commands and of groups; imports nothing."""
        del ctx
        sections = (
            ("Commands", self._command_lines()),
            ("Groups of commands", self._group_lines()),
        )
        for title, rows in sections:
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands, groups or options that begin so; imports no command."""
        found = [
            CompletionItem(name, help=line)
            for name, line in (*self._command_lines(), *self._group_lines())
            if name.startswith(incomplete)
        ]
        return found or super().shell_complete(ctx, incomplete)

    def _command_lines(self) -> list[tuple[str, str]]:
        return [(name, line) for name, (_, line) in self._lazy.items()]

    def _group_lines(self) -> list[tuple[str, str]]:
        return [(str(group.name), group.get_short_help_str(100)) for group in self._groups]


def _did_you_mean(name: str, commands: Sequence[str]) -> str:
    alike = [command for command in commands if command[:2] == name[:2]]
    # 'flight' is 0.44 similar to 'fly'. At that ratio most unlike names match, so the first two
    # letters must be equal.
    return did_you_mean(name, commands) or did_you_mean(name, alike, cutoff=0.4)


class _Root(LazyGroup):
    """The outermost group, where every error becomes one line and an exit code."""

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run the command line of this process; `--help` and `--version` print in here."""
        try:
            return super().main(*args, **extra)
        except OSError as error:
            fault = output_fault(error)
            if fault is None:
                raise
            click.echo(f"Error: {fault}", err=True)
            sys.exit(fault.exit_code)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command.

        Raises:
            Exit: the command failed, and the reason was printed.
        """
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.Abort, click.exceptions.Exit, BrokenPipeError):
            raise  # click's own; a closed pipe ends it quietly
        except KeyboardInterrupt as stop:
            click.echo(f"\nError: {stopped_by(stop)}", err=True)
            raise click.exceptions.Exit(UavBtError.exit_code) from stop
        except Exception as error:
            known = missing_extra(error) if isinstance(error, ModuleNotFoundError) else error
            known = output_fault(error) or known
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


_TREE: Final = LazyGroup(
    "tree",
    help="List nodes; draw tree files, write their schema.",
    lazy={
        "nodes": ("uav_bt.cli.tree:nodes", "List the nodes that tree files can use."),
        "render": ("uav_bt.cli.tree:render", "Draw a tree file, with its subtrees in place."),
        "schema": ("uav_bt.cli.tree:schema", "Write an XML Schema of tree files."),
    },
)
_RECORD: Final = LazyGroup(
    "record",
    help="Look into records of flights.",
    lazy={"info": ("uav_bt.cli.record:info", "Print the content of a record.")},
)
_TRAIN: Final = LazyGroup(
    "train",
    help="Train the networks that missions fly on.",
    lazy={
        "depth": ("uav_bt.cli.train:depth", "Train the depth network on flights."),
        "student": (
            "uav_bt.cli.train_student:student",
            "Train the control student on advised flights.",
        ),
    },
)
_EVALUATE: Final = LazyGroup(
    "evaluate",
    help="Measure networks against the twin's truth.",
    lazy={
        "depth": ("uav_bt.cli.evaluate:depth", "Measure metric depth."),
        "student": (
            "uav_bt.cli.evaluate:student",
            "Measure how well a control student agrees with the rule.",
        ),
    },
)
_EXPORT: Final = LazyGroup(
    "export",
    help="""Make ONNX files from trained weights.

    A network in 8-bit integers takes about half the time of one in floats. The ranges of its
    numbers are taken from images of the twin.""",
    lazy={
        "depth": ("uav_bt.cli.export:depth", "Export a depth network."),
        "student": ("uav_bt.cli.export:student", "Export a control student."),
    },
)
_NET: Final = LazyGroup(
    "net",
    help="Train, evaluate and export networks.",
    lazy={
        "perceive": ("uav_bt.cli.perceive:perceive", "Run perception over a video or a camera."),
        "collect": ("uav_bt.cli.collect:collect", "Fly and record for the control student."),
    },
    groups=(_TRAIN, _EVALUATE, _EXPORT),
)
_LAB: Final = LazyGroup(
    "lab",
    help="Begin and train labs, calibrate, tune the heading.",
    lazy={
        "new": ("uav_bt.cli.lab_schema:new", "Write a commented lab file to begin with."),
        "frames": ("uav_bt.cli.lab_frames:frames", "Take images of a lab from videos."),
        "pick": ("uav_bt.cli.lab_pick:pick", "Pick classes on the images of a lab."),
        "train": ("uav_bt.cli.lab_train:train", "Train the segmentation network of a lab."),
        "check": ("uav_bt.cli.lab_check:check", "Score the network of a lab on held-out picks."),
        "scenes": ("uav_bt.cli.lab:scenes", "List the shipped scenes, or draw the map of one."),
        "schema": ("uav_bt.cli.lab_schema:schema", "Write a JSON schema of lab files."),
        "calibrate": (
            "uav_bt.cli.lab:calibrate",
            "Calibrate a camera from photographs of a checkerboard.",
        ),
        "tune-heading": (
            "uav_bt.cli.lab:tune_heading",
            "Choose gains of the heading controller from a recorded flight.",
        ),
    },
)


@click.group(
    cls=_Root,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    lazy={
        "fly": ("uav_bt.cli.fly:fly", "Fly a mission."),
        "check": ("uav_bt.cli.check:check", "Check tree files and report all that is wrong."),
        "new": ("uav_bt.cli.check:new", "Write a commented mission file to begin with."),
        "simulate": ("uav_bt.cli.simulate:simulate", "Tick a tree with scripted leaves."),
        "campaign": ("uav_bt.cli.campaign:campaign", "Fly missions many times."),
        "report": ("uav_bt.cli.report:report", "Write the report of campaigns."),
        "shrink": (
            "uav_bt.cli.shrink:shrink_command",
            "Reduce a failed flight to its fewest causes.",
        ),
        "view": ("uav_bt.cli.record:view", "Show the record of a flight."),
        "replay": ("uav_bt.cli.record:replay", "Feed a recorded flight through the tree again."),
        "lsp": ("uav_bt.cli.lsp:lsp", "Check and complete tree files in editors."),
        "doctor": ("uav_bt.cli.doctor:doctor", "Check the installation."),
        "serve-anafi": ("uav_bt.cli.serve_anafi:serve_anafi", "Serve a simulated ANAFI."),
    },
    groups=(_TREE, _RECORD, _NET, _LAB),
)
@click.version_option(package.__version__, prog_name="uav-bt")
@click.option("--debug", is_flag=True, help="Show where an error came from.")
def uav_bt(*, debug: bool) -> None:
    """Compose, check, fly and measure vision-only drone missions."""
    del debug  # read from the context where errors are printed
    check_packages()
