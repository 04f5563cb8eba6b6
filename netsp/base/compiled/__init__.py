"""Compiled kernels: when they are compiled, and what kernels share, such as random numbers."""
