"""`uav-bt` itself: its commands are imported when they are asked for, its errors told in a line."""

from __future__ import annotations

import importlib
import traceback
from typing import Any, Final

import click

from uav_bt import __version__
from uav_bt.cli.rooms import check_rooms
from uav_bt.errors import UavBtError, did_you_mean

__all__ = ["Commands", "uav_bt"]

# Name, and where it stands. Nothing is imported for the commands that are not run.
_COMMANDS: Final = {
    "fly": "uav_bt.cli.fly:fly",
    "doctor": "uav_bt.cli.doctor:doctor",
    "serve-anafi": "uav_bt.cli.serve_anafi:serve_anafi",
    "new": "uav_bt.cli.new:new",
    "check": "uav_bt.cli.check:check",
    "nodes": "uav_bt.cli.nodes:nodes",
    "render": "uav_bt.cli.render:render",
    "simulate": "uav_bt.cli.simulate:simulate",
    "schema": "uav_bt.cli.schema:schema",
    "scenes": "uav_bt.cli.scenes:scenes",
    "calibrate": "uav_bt.cli.calibrate:calibrate",
    "perceive": "uav_bt.cli.perceive:perceive",
    "pick": "uav_bt.cli.pick:pick",
    "record": "uav_bt.cli.record:record",
    "replay": "uav_bt.cli.replay:replay",
    "view": "uav_bt.cli.view:view",
    "campaign": "uav_bt.cli.campaign:campaign",
    "report": "uav_bt.cli.report:report",
    "collect": "uav_bt.cli.collect:collect",
    "train": "uav_bt.cli.train:train",
    "export": "uav_bt.cli.export:export",
    "evaluate": "uav_bt.cli.evaluate:evaluate",
}


class Commands(click.Group):
    """A group whose commands are imported late and whose errors become messages."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands' names in the order in which a newcomer meets them."""
        del ctx
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command.

        Raises:
            UsageError: there is none of that name.
        """
        if cmd_name not in _COMMANDS:
            ctx.fail(f"there is no command '{cmd_name}'{did_you_mean(cmd_name, _COMMANDS)}")
        module, _, name = _COMMANDS[cmd_name].partition(":")
        command = getattr(importlib.import_module(module), name)
        return command if isinstance(command, click.Command) else None

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command and turn what it raises into a message and an exit code.

        Raises:
            Exit: the command failed, and has said why.
        """
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.Abort, click.exceptions.Exit, BrokenPipeError):
            raise  # click ends quietly when whoever reads the output has seen enough
        except UavBtError as error:
            _say_why(ctx, error, str(error))
            raise click.exceptions.Exit(error.exit_code) from error
        except Exception as error:
            message = f"unexpected {type(error).__name__}: {error}"
            hint = "" if ctx.params.get("debug") else " (`uav-bt --debug ...` shows where)"
            _say_why(ctx, error, message + hint)
            raise click.exceptions.Exit(UavBtError.exit_code) from error


def _say_why(ctx: click.Context, error: Exception, message: str) -> None:
    if ctx.params.get("debug"):
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    click.echo(f"Error: {message}", err=True)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="uav-bt")
@click.option("--debug", is_flag=True, help="Show where an error came from.")
def uav_bt(*, debug: bool) -> None:
    """Compose, check, fly and measure vision-only drone missions."""
    del debug  # read from the context, where errors are told
    check_rooms()
