"""What compiled loops need: random numbers, arrays that grow, hash slots."""
