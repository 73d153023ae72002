"""Guaranteed ranges of functions over boxes, and the functions that systems are factored with."""
