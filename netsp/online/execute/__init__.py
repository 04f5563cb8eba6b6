"""Carries out a tour online: follows it with the tether model, and repairs it when the world is not
as it was planned for."""

from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_log import Execution, ExecutionOptions
from netsp.online.execute.tour_execution import execute

__all__ = ["Event", "Execution", "ExecutionOptions", "Surprises", "execute"]
