"""Local search over orders of goals with exact choice of classes."""

from netsp.base.deprecated import deprecated_names
from netsp.gtsp.search.layers import LayeredInstance, best_classes
from netsp.gtsp.search.local_search import Search, local_search

__getattr__ = deprecated_names(globals(), Instance="LayeredInstance")

__all__ = ["LayeredInstance", "Search", "best_classes", "local_search"]
