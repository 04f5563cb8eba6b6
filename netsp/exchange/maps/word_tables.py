"""Tables of words in the source: sets of codes, and tags with their values."""

from __future__ import annotations


def words(text: str) -> frozenset[str]:
    """Return the words of a text as a set."""
    return frozenset(text.split())


def tags(table: str) -> dict[str, frozenset[str]]:
    """Return the values of each key of a table.

    Parameters
    ----------
    table : str
        Lines ``key = value value …``; a key may stand in several lines.

    Examples
    --------
    >>> {key: sorted(values) for key, values in tags("natural = rock stone").items()}
    {'natural': ['rock', 'stone']}
    """
    out: dict[str, frozenset[str]] = {}
    for line in table.strip().splitlines():
        key, _, values = line.partition(" = ")
        out[key.strip()] = out.get(key.strip(), frozenset()) | words(values)
    return out
