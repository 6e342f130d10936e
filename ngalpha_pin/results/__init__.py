"""Trajectories, and everything that judges them from arrays alone."""
