"""Bilateral constraints, one kind a file, and forces at frames."""
