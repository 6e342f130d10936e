"""One step by a method, each with the same signature."""
