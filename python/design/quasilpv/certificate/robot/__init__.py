"""Robots in exact arithmetic and in doubles, rebuilt from what an artifact says of them."""
