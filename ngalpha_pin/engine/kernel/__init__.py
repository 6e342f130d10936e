"""The compiled kernel and its binding; imports nothing of the package."""
