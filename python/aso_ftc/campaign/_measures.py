"""Measures of a run: numbers computed from its signals by an expression or a Python function.

An expression names signals as ``plant.x_p`` or, if the name is no name of Python,
``signal("plant.der(x)")``; ``time`` is the simulated time in s, ``parameter("plant.F_c")`` the value of
a parameter in this run and ``fault_start`` the start of its fault (NaN without one).
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._errors import ConfigurationError
from .._words import similar

__all__ = ["Expression", "PAPER_CLAIMS"]

Signal = NDArray[Any]

# The claims of Patton and Klinkhieo (2009) as `aso-ftc reproduce` checks them: limit cycle in the last
# three quarters of the time before the compensation starts at 40 s; residual motion from 20 s after it.
PAPER_CLAIMS = {
    "cart limit cycle": "amplitude(plant.x_p, start=10, end=40)",
    "pendulum limit cycle": "amplitude(plant.theta, start=10, end=40)",
    "cart residual": "amplitude(plant.x_p, start=60)",
    "pendulum residual": "amplitude(plant.theta, start=60)",
    "rms of f_fric - f_hat": "rms(plant.f_fric - controller.f_hat, start=60)",
}


def _slack(time: float) -> float:
    """The largest difference in s of two equal times: at most 1 us, or four last places, in seconds since 1970."""
    size = max(1.0, abs(time))
    return max(min(1e-9 * size, 1e-6), 4.0 * np.finfo(float).eps * size)


class _Window:
    """The rows of a run from ``start`` to ``end``, both in s and included."""

    def __init__(self, time: Signal, start: float | None, end: float | None) -> None:
        slack = _slack(float(time[-1])) if len(time) else 0.0
        low = 0 if start is None else int(np.searchsorted(time, start - slack, "left"))
        high = len(time) if end is None else int(np.searchsorted(time, end + slack, "right"))
        # NaN, the start of a fault that a run does not have, is no time.
        empty = (start is not None and np.isnan(start)) or (end is not None and np.isnan(end))
        self.rows = slice(0, 0) if empty else slice(low, high)
        self.time = time[self.rows]

    def of(self, signal: Any) -> Signal:
        values = np.asarray(signal)
        if values.ndim == 0:
            return np.full(len(self.time), values[()])
        return values[self.rows]


# The reductions: functions of a window, then signals and numbers; all give NaN for no rows.


def _over(function: Callable[[Signal], Any]) -> Callable[..., float]:
    def reduced(window: _Window, x: Any) -> float:
        values = np.asarray(window.of(x), float)
        return float(function(values)) if len(values) else np.nan

    return reduced


def _rms(values: Signal) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _integral(window: _Window, x: Any) -> float:
    """The integral over time, by trapezia."""
    values, time = window.of(x).astype(float), window.time
    return float(np.sum(np.diff(time) * (values[:-1] + values[1:])) / 2) if len(time) else np.nan


def _mean(window: _Window, x: Any) -> float:
    """The integral divided by the duration; of a single row its value."""
    values, time = window.of(x).astype(float), window.time
    if not len(time):
        return np.nan
    span = float(time[-1] - time[0])
    return _integral(window, x) / span if span > 0 else float(values[-1])


def _at(window: _Window, x: Any, t: Any) -> float:
    """The value at the last row up to the time t; NaN if t is NaN."""
    moment = float(t)
    row = int(np.searchsorted(window.time, moment + _slack(moment), "right")) - 1
    return float(window.of(x)[row]) if row >= 0 and not np.isnan(moment) else np.nan


def _first_time(window: _Window, condition: Any) -> float:
    """The first time at which the condition holds; NaN if it never does."""
    holds = window.of(condition).astype(bool)
    return float(window.time[int(np.argmax(holds))]) if holds.any() else np.nan


def _last_time(window: _Window, condition: Any) -> float:
    """The last time at which the condition holds; NaN if it never does."""
    holds = window.of(condition).astype(bool)
    return float(window.time[len(holds) - 1 - int(np.argmax(holds[::-1]))]) if holds.any() else np.nan


def _time_while(window: _Window, condition: Any) -> float:
    """The duration in s for which the condition holds; a row stands for the time up to the next one."""
    holds = window.of(condition).astype(bool)
    return float(np.sum(np.diff(window.time)[holds[:-1]])) if len(holds) else np.nan


def _time_above(window: _Window, x: Any, limit: Any) -> float:
    """The duration in s for which x is above the limit."""
    return _time_while(window, np.greater(x, limit))


def _settling_time(window: _Window, x: Any, band: Any, target: Any = 0.0) -> float:
    """The time in s after the start of the window from which on ``|x - target| <= band`` holds to its
    end; NaN if it does not hold at the end."""
    time = window.time
    outside = ~(np.abs(window.of(x) - window.of(target)) <= window.of(band))
    if not len(time) or outside[-1]:
        return np.nan
    rows = np.flatnonzero(outside)
    return float(time[rows[-1] + 1] - time[0]) if len(rows) else 0.0


def _rises(window: _Window, condition: Any) -> float:
    """How often the condition begins to hold after the first row."""
    holds = window.of(condition).astype(bool)
    return float(np.count_nonzero(holds[1:] & ~holds[:-1])) if len(holds) else np.nan


_REDUCTIONS: dict[str, Callable[..., float]] = {
    "max": _over(np.max),
    "min": _over(np.min),
    "amplitude": _over(lambda values: 0.5 * (np.max(values) - np.min(values))),
    "rms": _over(_rms),
    "first": _over(lambda values: values[0]),
    "last": _over(lambda values: values[-1]),
    "mean": _mean,
    "integral": _integral,
    "at": _at,
    "first_time": _first_time,
    "last_time": _last_time,
    "time_while": _time_while,
    "time_above": _time_above,
    "settling_time": _settling_time,
    "rises": _rises,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in ("abs", "sqrt", "exp", "log", "log10", "sin", "cos", "tan", "arctan2", "hypot", "sign")
} | {"maximum": np.maximum, "minimum": np.minimum}
_CONSTANTS = {"pi": np.pi}


def _of_numbers(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return an operator on floats: of NumPy's own, integers overflow, and a sum of Booleans is a Boolean."""
    return lambda *sides: function(*(np.asarray(side, float) for side in sides))


_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: _of_numbers(np.add),
    ast.Sub: _of_numbers(np.subtract),
    ast.Mult: _of_numbers(np.multiply),
    ast.Div: _of_numbers(np.divide),
    ast.Pow: _of_numbers(np.power),
    ast.USub: _of_numbers(np.negative),
    ast.UAdd: lambda x: x,
    ast.Not: np.logical_not,
    ast.And: np.logical_and,
    ast.Or: np.logical_or,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}


@dataclass
class _Run:
    """What an expression reads."""

    signals: Mapping[str, Signal]
    time: Signal
    parameters: Mapping[str, Any]
    fault_start: float


_Code = Callable[[_Run], Any]


class Expression:
    """An expression, read once and evaluated for each run.

    Attributes:
        text: the expression.
        signals: the names of the signals that it reads, ``"fmu.variable"``.
        parameters: the names of the parameters that it reads.

    Raises:
        ConfigurationError: it is no expression, or names an unknown function.
    """

    def __init__(self, name: str, text: str) -> None:
        self.text = text
        self.signals: set[str] = set()
        self.parameters: set[str] = set()
        self._name = name
        try:
            self._code = self._compile(ast.parse(text.strip(), mode="eval").body)
        except (SyntaxError, ValueError) as error:
            if isinstance(error, ConfigurationError):
                raise
            raise self._wrong(f"{text!r} is no expression: {error}") from None
        except RecursionError:
            raise self._wrong("the expression is nested too deeply") from None

    def __reduce__(self) -> tuple[Any, ...]:
        return Expression, (self._name, self.text)

    def _wrong(self, text: str) -> ConfigurationError:
        place = f"measures.{self._name}"
        return ConfigurationError(f"{place}: {text}", "Campaign", {"name": place})

    def value(
        self,
        signals: Mapping[str, Signal],
        time: Signal,
        parameters: Mapping[str, Any],
        fault_start: float = np.nan,
    ) -> float:
        """Return the value for one run."""
        with np.errstate(all="ignore"):
            value = self._code(_Run(signals, time, parameters, fault_start))
        if np.ndim(value) != 0:
            raise self._wrong(
                f"{self.text!r} is a signal, expected a number: put a function such as max or last around it"
            )
        return float(value)

    def _compile(self, node: ast.expr) -> _Code:
        if isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
            constant = node.value
            return lambda run: constant
        if isinstance(node, (ast.UnaryOp, ast.BinOp)):
            inner = [node.operand] if isinstance(node, ast.UnaryOp) else [node.left, node.right]
            return _joined(self._operator(node.op), [self._compile(part) for part in inner])
        if isinstance(node, ast.BoolOp):
            code = self._compile(node.values[0])
            for value in node.values[1:]:
                code = _joined(_OPERATORS[type(node.op)], [code, self._compile(value)])
            return code
        if isinstance(node, ast.Compare):
            sides = [self._compile(side) for side in (node.left, *node.comparators)]
            pairs = zip(node.ops, sides, sides[1:], strict=False)
            parts = [_joined(self._operator(op), [left, right]) for op, left, right in pairs]
            return (
                parts[0] if len(parts) == 1 else _joined(lambda *all_of: np.logical_and.reduce(all_of), parts)
            )
        if isinstance(node, ast.Call):
            return self._call(node)
        return self._named(node)

    def _operator(self, operator: ast.AST) -> Callable[..., Any]:
        if type(operator) not in _OPERATORS:
            raise self._wrong(
                f"{self.text!r} has an unknown operator: expected + - * / **, and, or, not, < and >"
            )
        return _OPERATORS[type(operator)]

    def _named(self, node: ast.expr) -> _Code:
        name = ast.unparse(node)
        if isinstance(node, ast.Name):
            if name == "time":
                return lambda run: run.time
            if name == "fault_start":
                return lambda run: run.fault_start
            if name in _CONSTANTS:
                return lambda run: _CONSTANTS[name]
        if isinstance(node, (ast.Attribute, ast.Subscript)):
            # Names of elements have no spaces: K_x[1,2].
            return self._signal(name.replace(" ", "").replace("[(", "[").replace(")]", "]"))
        raise self._wrong(f"{name!r} is no signal: expected fmu.variable, a number or a function")

    def _signal(self, name: str) -> _Code:
        self.signals.add(name)
        return lambda run: run.signals[name]

    def _call(self, node: ast.Call) -> _Code:
        name = ast.unparse(node.func)
        if name in ("signal", "parameter"):
            if len(node.args) != 1 or not isinstance(node.args[0], ast.Constant) or node.keywords:
                raise self._wrong(f"{name}(...): expected one name in quotes")
            identifier = str(node.args[0].value)
            if name == "signal":
                return self._signal(identifier)
            self.parameters.add(identifier)
            return lambda run: run.parameters[identifier]
        if name not in _REDUCTIONS and name not in _FUNCTIONS:
            known = [*_REDUCTIONS, *_FUNCTIONS]
            hint = similar(name, known) or f": expected one of {', '.join(known)}"
            raise self._wrong(f"unknown function {name}{hint}")
        arguments = [self._compile(argument) for argument in node.args]
        if name in _FUNCTIONS:
            if node.keywords:
                raise self._wrong(f"{name} has no named arguments")
            return self._checked(name, _joined(_FUNCTIONS[name], arguments))
        keywords = {}
        for keyword in node.keywords:
            if keyword.arg not in ("start", "end") and not (
                name == "settling_time" and keyword.arg in ("band", "target")
            ):
                raise self._wrong(f"{name}: unknown argument {keyword.arg}, expected start or end")
            keywords[keyword.arg] = self._compile(keyword.value)
        reduction = _REDUCTIONS[name]

        def reduced(run: _Run) -> float:
            options = {key: code(run) for key, code in keywords.items()}
            window = _Window(run.time, options.pop("start", None), options.pop("end", None))
            return reduction(window, *(code(run) for code in arguments), **options)

        return self._checked(name, reduced)

    def _checked(self, name: str, code: _Code) -> _Code:
        def called(run: _Run) -> Any:
            try:
                return code(run)
            except TypeError as error:
                raise self._wrong(f"{name}: wrong arguments: {error}") from None

        return called


def _joined(function: Callable[..., Any], parts: list[_Code]) -> _Code:
    return lambda run: function(*(part(run) for part in parts))
