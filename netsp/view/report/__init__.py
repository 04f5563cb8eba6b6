"""Reports: self-contained pages about tours, runs, missions and comparisons."""
