"""Execution of a tour: follow it with the tether model, and repair it when the world is not as
planned."""

from netsp.online.execute.events import Event, Surprises
from netsp.online.execute.execution_log import Execution, ExecutionOptions
from netsp.online.execute.tour_execution import execute

__all__ = ["Event", "Execution", "ExecutionOptions", "Surprises", "execute"]
