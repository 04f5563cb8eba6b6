"""Foundations that know nothing of tethers: errors, files, clocks, registries, compiled kernels,
geometry."""
