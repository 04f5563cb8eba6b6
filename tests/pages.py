"""Contents of packed pages (`netsp.view.pictures.interactive`)."""

import base64
import gzip
import json
import re


def unpacked(file):
    """The figure of a page."""
    packed = json.loads(re.search(r"const packed = (\[.*?\]);", file.read_text()).group(1))
    library, figure = (gzip.decompress(base64.b64decode(text)).decode() for text in packed)
    assert "Plotly" in library
    return json.loads(figure)
