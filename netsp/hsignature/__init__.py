"""Homotopy signatures: words of a free group, and the word of a path."""

from netsp.hsignature.rays import crossings, signature
from netsp.hsignature.words import (
    EMPTY,
    Word,
    concatenate,
    cyclically_reduced,
    entangled,
    invert,
    is_looping,
    reduce,
)

__all__ = [
    "EMPTY",
    "Word",
    "concatenate",
    "crossings",
    "cyclically_reduced",
    "entangled",
    "invert",
    "is_looping",
    "reduce",
    "signature",
]
