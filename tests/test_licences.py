"""What netsp needs goes with its licence, and every extra is in the bill."""

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


sys.path.insert(0, str(ROOT / "docs" / "hooks"))

import licences  # noqa: E402


def test_every_dependency_has_a_licence_that_goes_with_ours():
    bill = licences.bill()
    assert {"numpy", "numba", "pydantic", "pulp", "highspy", "shapely"} <= {n.name for n in bill}
    assert not [(n.name, n.licence) for n in bill if not n.allowed]


def test_a_licence_that_does_not_is_seen():
    """The check itself."""
    for text in (
        "GNU General Public License v3 (GPLv3)",
        "GPL-3.0-only",
        "Proprietary",
        "not told",
    ):
        assert not licences.Needed("x", "1", text).allowed, text
    for text in ("MIT", "BSD License", "LGPL-3.0", "Apache-2.0 OR BSD-2-Clause", "EPL-2.0"):
        assert licences.Needed("x", "1", text).allowed, text


def test_the_bill_has_every_extra_of_users():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    of_users = set(project["optional-dependencies"]) - {"test", "docs", "dev", "bench", "all"}
    assert set(licences.EXTRAS) == of_users
    (whole,) = project["optional-dependencies"]["all"]
    assert whole == f"netsp[{','.join(licences.EXTRAS)}]"
