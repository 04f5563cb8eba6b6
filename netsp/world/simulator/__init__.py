"""The simulator: a vehicle and its tether that carry out a mission in a scene."""
