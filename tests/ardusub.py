"""ArduSub's own simulator for tests, where the environment variable NETSP_ARDUSUB names its binary.

Started as `sim_vehicle.py` would start it, but on loopback and with nothing else: vectored frame,
telemetry to a UDP port of ours. Parameters are those that let a ground station fly it without a
pilot at the sticks.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.autopilot import reserve_port

BINARY = os.environ.get("NETSP_ARDUSUB", "")

REASON = "NETSP_ARDUSUB names no ArduSub simulator"

HOME = "55.6,12.95,0,0"
"""Latitude, longitude, altitude and heading of where it starts."""

PARAMETERS = {
    "MAV_SYSID": 1, "FS_GCS_ENABLE": 0, "FS_PILOT_INPUT": 0, "FS_EKF_ACTION": 0,
    "ARMING_SKIPCHK": -1, "WPNAV_SPEED": 50,
}  # fmt: skip


class ArduSub:
    """The process, for a test; the ground station listens on `port`."""

    def __init__(self, pace: float = 1.0, parameters: dict[str, float] | None = None) -> None:
        self.reservation = reserve_port()
        self.port, self.pace = int(self.reservation.getsockname()[1]), pace
        self.parameters = {**PARAMETERS, **(parameters or {})}
        self._folder = tempfile.TemporaryDirectory()

    def __enter__(self) -> ArduSub:
        defaults = Path(self._folder.name) / "defaults.parm"
        defaults.write_text("".join(f"{k} {v}\n" for k, v in self.parameters.items()))
        self.process = subprocess.Popen(
            [BINARY, "-S", "-w", "--model", "vectored", "--speedup", str(self.pace), "-I", "0",
             "--home", HOME, "--defaults", str(defaults),
             f"--serial0=udpclient:127.0.0.1:{self.port}"],
            cwd=self._folder.name, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._folder.cleanup()
        self.reservation.close()

    def until(self, condition: Callable[[], Any], seconds: float = 90.0) -> Any:
        """Wait for something to come true; seconds are those of the wall."""
        end = time.monotonic() + seconds
        while not (found := condition()):
            assert self.process.poll() is None, "the simulator has ended"
            assert time.monotonic() < end, "waited in vain"
            time.sleep(0.05)
        return found
