"""Local search over orders of goals with exact choice of classes."""

from netsp.lns.layers import Instance, best_classes
from netsp.lns.search import Search, local_search

__all__ = ["Instance", "Search", "best_classes", "local_search"]
