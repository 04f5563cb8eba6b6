"""Maps in, missions out."""
