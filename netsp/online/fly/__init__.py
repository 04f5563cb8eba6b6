"""Flights: tours carried out by a real vehicle over MAVLink."""
