"""Carries out a tour online: follows it with the tether model, and repairs it when the world is not
as it was planned for."""

from netsp.execute.events import Event, Surprises
from netsp.execute.log import Execution, ExecutionOptions
from netsp.execute.run import execute

__all__ = ["Event", "Execution", "ExecutionOptions", "Surprises", "execute"]
