"""From a problem's geometry to its travel graph."""
