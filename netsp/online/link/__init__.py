"""How netsp talks to a vehicle: MAVLink over UDP (extra `mavlink`)."""
