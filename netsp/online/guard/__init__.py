"""Guard of a tether: follows the tether of a vehicle that somebody else drives."""
