"""Flights of a real autopilot that tests read."""

from __future__ import annotations

import gzip
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.DFReader import DFReader_binary

DATA = Path(__file__).parent / "data" / "ardusub47"


@cache
def log(name: str) -> dict[str, list[dict[str, Any]]]:
    """Return the messages of a vehicle's log by their kind."""
    reader = DFReader_binary.__new__(DFReader_binary)
    raw = gzip.decompress((DATA / f"{name}.BIN.gz").read_bytes())
    found: dict[str, list[dict[str, Any]]] = {}
    with tempfile.NamedTemporaryFile(suffix=".BIN") as file:
        file.write(raw)
        file.flush()
        DFReader_binary.__init__(reader, file.name)
        while (message := reader.recv_match()) is not None:
            row = message.to_dict()
            row["t"] = row.get("TimeUS", 0) / 1e6
            found.setdefault(message.get_type(), []).append(row)
        reader.data_map.close()
        reader.filehandle.close()
    return found


@cache
def track(name: str) -> np.ndarray:
    """Return time, true x, y, z and believed x, y, z of a flight, a row each."""
    with gzip.open(DATA / f"{name}-true.csv.gz", "rt") as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)
