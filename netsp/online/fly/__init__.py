"""Tours carried out by a real vehicle, over MAVLink."""
