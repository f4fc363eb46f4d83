"""The exceptions of aso_ftc."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._words import in_python

if TYPE_CHECKING:
    from ._results import Results

__all__ = [
    "CancelledError",
    "ConfigurationError",
    "DesignError",
    "Error",
    "FmuError",
    "MissingPackageError",
    "ResultsError",
    "RunError",
    "TimeLimitError",
]


class Error(Exception):
    """Base class of all exceptions of aso_ftc. Its text is one sentence.

    Attributes:
        kind: the kind of the error, a name such as ``"UnknownVariable"``.
        fields: the data of the error by name; each entry is also an attribute.
    """

    kind: str
    fields: dict[str, Any]

    def __init__(self, message: str, kind: str = "Other", fields: dict[str, Any] | None = None) -> None:
        super().__init__(in_python(message))
        self.kind = kind
        self.fields = dict(fields or {})

    def __getattr__(self, name: str) -> Any:
        # Only called for names that are no attributes.
        fields = self.__dict__.get("fields", {})
        if name in fields:
            return fields[name]
        raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.kind, self.fields)


class ConfigurationError(Error, ValueError):
    """An entry, a name or a setting is wrong: found before the first step.

    Attributes:
        path, line, column: the place in the file, if there is a file.
    """

    path: str | None = None
    line: int | None = None
    column: int | None = None

    def __init__(self, message: str, kind: str = "Other", fields: dict[str, Any] | None = None) -> None:
        super().__init__(message, kind, fields)
        self.path, self.line = self.fields.get("path"), self.fields.get("line")
        self.column = self.fields.get("column")


class FmuError(Error):
    """An FMU cannot be read, loaded or instantiated.

    Attributes:
        fmu: its name in the system, ``None`` outside of a system.
    """

    fmu: str | None = None

    def __init__(self, message: str, kind: str = "Other", fields: dict[str, Any] | None = None) -> None:
        super().__init__(message, kind, fields)
        self.fmu = self.fields.get("within")


class RunError(Error, RuntimeError):
    """A run failed after its start.

    Attributes:
        time: simulated time in s that the run reached.
        fmu: the FMU that failed, ``None`` if no call of an FMU failed.
        function, status: the function of FMI that failed and how.
        messages: the messages of the FMU during that call.
        results: the rows up to the failure; not kept when the exception is pickled.
    """

    time: float | None = None
    fmu: str | None = None
    function: str | None = None
    status: str | None = None
    messages: list[str]
    results: Results | None = None

    def __init__(self, message: str, kind: str = "Other", fields: dict[str, Any] | None = None) -> None:
        super().__init__(message, kind, fields)
        entries = self.fields
        self.time, self.fmu = entries.get("time"), entries.get("fmu")
        self.function, self.status = entries.get("function"), entries.get("status")
        self.messages = list(entries.get("messages", ()))


class TimeLimitError(RunError, TimeoutError):
    """A run reached the time limit of ``run(time_limit=...)``."""


class CancelledError(RunError):
    """A run was ended by :meth:`Cancel.cancel`."""


class DesignError(Error, ValueError):
    """A controller cannot be designed."""


class ResultsError(Error, OSError):
    """Results cannot be written or read.

    Attributes:
        results: the rows of a run whose file cannot be written; not kept when the exception is pickled.
    """

    results: Results | None = None


class MissingPackageError(Error, ImportError):
    """A Python package is missing that a function needs."""
