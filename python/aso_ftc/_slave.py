"""Python objects that step together with FMUs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

__all__ = ["Slave"]


class Slave(Protocol):
    """What a Python object needs to take part in a :class:`System`.

    The object has the attributes ``inputs`` and ``outputs``: a list of names, or a dict of names and
    start values (``float``, ``int`` or ``bool``, which is also the type of the variable; an ``int`` has 32 bits). Optional:

    * ``direct = False`` states that no output depends on the inputs of the same time.
    * ``start(t, inputs)`` is called before the first step of every run, and may return outputs.
    * ``stop()`` is called at the end of a run, also of one that fails; then ``sys.unraisablehook`` gets its exception.
    * ``save()`` returns a state that can be pickled, ``restore(state)`` returns to it. With both, the
      object can take part in iterations and in :meth:`Simulation.save`.
    """

    def step(self, t: float, dt: float, inputs: dict[str, float]) -> Mapping[str, float] | None:
        """Step from ``t`` to ``t + dt`` (in s) with these inputs; return the outputs at ``t + dt``.

        Outputs that are not in the result, or all of them if it is ``None``, keep their values.
        """
        ...
