"""Missions in three dimensions: their files, equipment, limits, plans and run logs."""
