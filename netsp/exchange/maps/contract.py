"""Contract of docs/sites.md: what each feature of a map is.

The first rule that matches decides: the user (`--map`), a property `kind`, the name of the layer,
object classes of charts and tags of OpenStreetMap, the shape.
"""

from __future__ import annotations
