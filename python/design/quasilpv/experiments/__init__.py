"""Closed-loop experiments: designs cached by their inputs, runs in one process or over LCM, and their metrics."""
