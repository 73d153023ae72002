"""Feedback for general systems, with the region it is proved in: from a request to a design."""
