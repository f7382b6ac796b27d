"""Parameter files: values of ports and variables, and variants of them for campaigns.

A YAML file:

    set: {ExploreFor.min_gain: 0.01}   # ports by NODE.PORT; NODE is a node's name or path
    var: {laps: 3}                     # variables of the main tree
    variants:                          # for campaigns: each is flown, and is a row of the report
      slow: {var: {laps: 2}}
      fast: {var: {laps: 5}, set: {TakeOff.height_m: 1.2}}

A variant also has the values of the whole file. The variant's values take precedence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from uav_bt.errors import ValueRangeError
from uav_bt.tree.loading.findings import Position
from uav_bt.tree.loading.parameters import SET, VAR, Parameters, split_port
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.port import port_text
from uav_bt.yaml_file import YamlFile, read_yaml


@dataclass(frozen=True, kw_only=True)
class ParameterFile:
    """The content of a parameter file."""

    path: Path
    common: Parameters = field(default_factory=Parameters)  # of the whole file
    variants: Mapping[str, Parameters] = field(default_factory=dict)  # each with those of the file


def read_parameters(path: Path | str) -> ParameterFile:
    """Read a parameter file, or raise a FileError that names the line."""
    file = read_yaml(Path(path), _ParameterFile, "parameter file")
    common = _parameters(file, file.value)
    variants = {
        name: _parameters(file, values, "variants", name).over(common)
        for name, values in file.value.variants.items()
    }
    return ParameterFile(path=file.path, common=common, variants=variants)


def _node_port(name: str) -> str:
    split_port(name)
    return name


def _variant_name(name: str) -> str:
    if not name.replace("-", "").replace("_", "").replace(".", "").isalnum():
        raise ValueRangeError(
            f"expected a variant's name of letters, digits, '-', '_' and '.', got '{name}'"
        )
    return name


_Value = bool | int | Annotated[float, Field(allow_inf_nan=False)] | str
_NodePort = Annotated[str, AfterValidator(_node_port)]
_VariantName = Annotated[str, AfterValidator(_variant_name)]


@dataclass(frozen=True, kw_only=True)
class _Values:
    set: dict[_NodePort, _Value] = field(default_factory=dict)
    var: dict[str, _Value] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _ParameterFile(_Values):
    variants: dict[_VariantName, _Values] = field(default_factory=dict)


def _parameters(file: YamlFile[_ParameterFile], values: _Values, *steps: str) -> Parameters:
    return Parameters(
        ports={name: port_text(value) for name, value in values.set.items()},
        variables=values.var,
        places={
            (kind, name): Place(file.path, Position(file.line(*steps, kind, name), 1))
            for kind, names in ((SET, values.set), (VAR, values.var))
            for name in names
        },
    )
