"""Link to a vehicle: MAVLink over UDP (extra `mavlink`)."""
