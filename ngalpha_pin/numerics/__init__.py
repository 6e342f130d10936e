"""What knows arrays only: matrices, spatial algebra, and solvers of one contact problem y = b + G P."""
