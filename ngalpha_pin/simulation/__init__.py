"""The time loop and its recorder."""
