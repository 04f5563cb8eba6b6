"""Plan on a map, in the browser (`netsp app`, docs/app.md)."""
