"""Link to a vehicle: MAVLink over UDP (needs the extra `mavlink`)."""
