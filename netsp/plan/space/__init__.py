"""NE-TSP in space: classes of paths in any scene, and tours through them."""
