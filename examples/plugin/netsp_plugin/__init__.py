"""A solver, a tether model and a planner for netsp third-party."""
