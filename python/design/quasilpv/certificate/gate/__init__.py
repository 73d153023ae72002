"""The robust gates: a proof where the loop decouples into scalar ones, a grid elsewhere."""
