"""Plan on a map, in the browser (`netsp app`, docs/guide/plan-on-the-map.md)."""
