"""Problems written to files."""

import json
from pathlib import Path

SCENE = {
    "schema_version": 1, "bounds": [-1, -4, -4, 9, 4, 1],
    "solids": [
        {"post": {"center": [3.0, 0.4], "radius": 0.5}},
        {"post": {"center": [5.0, -1.0], "radius": 0.5}},
        {"post": {"center": [5.2, 1.6], "radius": 0.5}},
    ],
}  # fmt: skip


WAYPOINTS = [[4.2, 2.8, -1.0], [6.5, 0.2, -1.5], [4.0, -1.8, -0.5], [6.4, 2.6, -1.0]]


def written(folder: Path, **more) -> Path:
    """A mission among three posts, with its waypoints in a poor order."""
    (folder / "scene.json").write_text(json.dumps(SCENE))
    mission = {
        "schema_version": 1, "scene": "scene.json", "anchor": [0, 0, 0], "start": [0, 0.3, 0],
        "waypoints": WAYPOINTS, "clearance": 0.2, "tether_length": 8.5, "delta": 0.2, "cell": 0.25,
        **more,
    }  # fmt: skip
    file = folder / "mission.json"
    file.write_text(json.dumps(mission))
    return file
