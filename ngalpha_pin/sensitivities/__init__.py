"""Derivatives of steps and of runs: of the steps that were taken, with the moments at which they are divided."""
