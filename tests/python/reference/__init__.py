"""Plain numpy implementations of the control step and of the plant, written from the formulas, for comparison only."""
