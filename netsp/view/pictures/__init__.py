"""Pictures of problems, scenes, missions and executions."""
