"""Local search over orders of goals with exact choice of classes."""

from netsp.gtsp.search.layers import Instance, best_classes
from netsp.gtsp.search.local_search import Search, local_search

__all__ = ["Instance", "Search", "best_classes", "local_search"]
