"""Files that speak of places: truths, positions, distance matrices, ready vectors."""
