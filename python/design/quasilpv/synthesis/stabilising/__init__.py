"""The laws that bring a robot to rest: the conditions of chapters I to III with the least gain."""
