"""One file per theorem: the conditions that the registry knows by name."""
