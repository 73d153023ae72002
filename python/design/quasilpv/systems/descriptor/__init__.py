"""Descriptor systems: equations, premises with proved bounds, and what can be proved of their structure."""
