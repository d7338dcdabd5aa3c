"""Faults that come and go at a test's word: by the clock, a busy machine would miss them or meet them too early."""

from drivers.sim.faults import FaultPlan, parse


class SwitchedPlan(FaultPlan):
    """A fault plan to be changed while an emulator follows it."""

    def begin(self, fault):
        """From now on. As written in a plan, without a start."""
        self._faults = (*self._faults, parse(fault))

    def end(self):
        """All of them."""
        self._faults = ()
