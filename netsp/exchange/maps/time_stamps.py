"""Time stamps of tables: numbers of any unit, dates with times, clock times, and empty cells."""

from __future__ import annotations
