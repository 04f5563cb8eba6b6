"""What every run of a solver shares: limits, incumbent, bound, report, options, leg costs."""
