"""Results of comparisons as one page with figures and tables."""
