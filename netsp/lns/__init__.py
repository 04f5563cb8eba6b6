"""Local search over orders of goals with exact choice of classes."""

from netsp.lns.layers import Instance, best_classes
from netsp.lns.search import local_search

__all__ = ["Instance", "best_classes", "local_search"]
