"""The trees of a campaign: each file with each variant of the parameters, loaded and checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from uav_bt.app import provenance
from uav_bt.app.loading import Mission, is_text, load_mission
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import PlannedTree
from uav_bt.errors import InputError
from uav_bt.tree import MissionTree
from uav_bt.tree.loading.parameter_file import ParameterFile
from uav_bt.tree.loading.parameters import Parameters, Plain
from uav_bt.tree.shipped import shipped_missions


def planned_trees(
    tree: Mission, options: FlightOptions
) -> Iterator[tuple[MissionTree, PlannedTree]]:
    """Yield a tree of a campaign, loaded and planned, once for each variant of the parameters.

    Args:
        tree: A tree file, a shipped mission's name, or a tree that was loaded from a file.
        options: How the campaign is flown, with its parameter file.

    Raises:
        InputError: The tree has no file, or it was refused with the values of a variant.
    """
    own = Parameters()
    loaded = tree if isinstance(tree, MissionTree) else None
    if loaded is not None:
        own = _own_values(loaded)
        tree = loaded.path
    elif not isinstance(tree, str | Path) or is_text(tree):
        what = "a text: " if isinstance(tree, str) else ""
        raise InputError(
            f"a campaign flies tree files, which its workers read; got {what}{tree!r:.40}"
        )
    for variant, values in _variants(options).items():
        below = ParameterFile(path=Path("campaign"), common=own.over(values))
        mission = load_mission(tree, replace(options, params=below))
        if loaded is not None:
            _check_same(mission, loaded)
        yield mission, _planned(mission, variant, own.over(values), options)


def _variants(options: FlightOptions) -> dict[str, Parameters]:
    """Return the values of each variant; without variants the common ones, by an empty name."""
    file = options.params
    if not isinstance(file, ParameterFile):
        return {"": Parameters()}
    return dict(file.variants) or {"": file.common}


def _planned(
    mission: MissionTree, variant: str, values: Parameters, options: FlightOptions
) -> PlannedTree:
    # A shipped mission by its name is found on other machines and in other installations, too.
    path = mission.path
    shipped = path in {file.resolve() for file in shipped_missions().values()}
    common = options.parameters
    return PlannedTree(
        name=f"{path.stem}[{variant}]{path.suffix}" if variant else path.name,
        path=path.stem if shipped else str(path),
        sha256=provenance.sha256_of(mission),
        # Values of the command line take precedence over a variant.
        ports={
            name: text
            for name, text in values.ports.items()
            if name not in options.ports and common.ports.get(name) != text
        },
        variables={
            name: value
            for name, value in values.variables.items()
            if name not in options.variables and common.variables.get(name) != value
        },
    )


def _own_values(tree: MissionTree) -> Parameters:
    """Return the ports and variables that a loaded tree has instead of those of its file.

    Raises:
        InputError: The tree has no file, or a variable is neither a number nor a text.
    """
    if not tree.sources or not tree.path.is_file():
        raise InputError(
            f"tree '{tree.name}' has no file, and each flight of a campaign has a process of its "
            "own that reads one: write the tree to a file, or fly it with app.fly(...)"
        )
    variables: dict[str, Plain] = {}
    for name, value in tree.variables.snapshot().items():
        if not isinstance(value, Plain):
            raise InputError(
                f"variable '{name}' of tree '{tree.name}' is {value!r:.40}, and a campaign keeps "
                "numbers and texts only: fly the tree with app.fly(...)"
            )
        variables[name] = value
    return Parameters(
        ports={
            f"{path}.{port}": text
            for path, given in tree.replaced.items()
            for port, text in given.items()
        },
        variables=variables,
    )


def _check_same(mission: MissionTree, loaded: MissionTree) -> None:
    """Refuse a loaded tree whose files now give another one.

    Raises:
        InputError: They do.
    """
    # Values from outside are given again with the places of their files, which are not read again.
    changed = any(loaded.sources.get(path) != data for path, data in mission.sources.items())
    if mission.name != loaded.name or changed:
        raise InputError(
            f"tree '{loaded.name}' of {loaded.path} is another one when it is read again for the "
            "campaign: its files have changed, or it needs the `tree_id` and `tree_folders` that "
            "it was loaded with"
        )
