"""One frictional contact problem y = b + G P; knows arrays only."""
