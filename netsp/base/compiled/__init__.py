"""Compiled kernels: when they are compiled, and random numbers, growing arrays and hash tables in
them."""
