"""Model descriptions."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

from . import _core

__all__ = ["DefaultExperiment", "ModelDescription", "Variable", "read_model_description"]


@dataclass(frozen=True)
class DefaultExperiment:
    """The proposed experiment of an FMU: times and step in s, relative tolerance."""

    start_time: float | None = None
    stop_time: float | None = None
    tolerance: float | None = None
    step_size: float | None = None


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU."""

    name: str
    value_reference: int
    type: str
    """The element of the XML: ``Real``, ``Integer``, ...; in FMI 3.0 ``Float64``, ``Int32``, ..."""
    causality: str
    variability: str
    initial: str | None = None
    description: str | None = None
    declared_type: str | None = None
    shape: tuple[int, ...] = ()
    """The extents of an array (FMI 3.0); empty for a scalar."""
    start: Any = None
    """The start value; of an array the list of its elements in row-major order."""
    unit: str | None = None
    nominal: float | None = None
    min: float | None = None
    max: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", tuple(self.shape))


@dataclass(frozen=True)
class ModelDescription:
    """The content of ``modelDescription.xml``."""

    fmi_version: str
    model_name: str
    guid: str
    """``guid``, in FMI 3.0 ``instantiationToken``."""
    variables: tuple[Variable, ...]
    default_experiment: DefaultExperiment
    interfaces: tuple[str, ...]
    """Of ``"co-simulation"``, ``"model-exchange"``, ``"scheduled-execution"``."""
    model_identifier: str | None = None
    capabilities: dict[str, bool] = field(default_factory=dict)
    """The capability flags of co-simulation, by their names in FMI 2.0."""
    description: str | None = None
    author: str | None = None
    version: str | None = None
    copyright: str | None = None
    license: str | None = None
    generation_tool: str | None = None
    generation_date_and_time: str | None = None
    warnings: tuple[str, ...] = ()
    """What the archive and the description do that the standard forbids."""

    def __getitem__(self, name: str) -> Variable:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(name)


def read_model_description(path: str | os.PathLike[str]) -> ModelDescription:
    """Read the model description of an FMU of FMI 1.0, 2.0 or 3.0, an archive or a folder.

    Raises:
        FmuError: the FMU or its description cannot be read.
    """
    own = _core.read_model_description(os.fspath(path))
    variables = tuple(Variable(**variable) for variable in own.pop("variables"))
    experiment = DefaultExperiment(**own.pop("default_experiment"))
    interfaces, warnings = tuple(own.pop("interfaces")), tuple(own.pop("warnings"))
    return ModelDescription(
        variables=variables,
        default_experiment=experiment,
        interfaces=interfaces,
        warnings=warnings,
        **own,
    )
