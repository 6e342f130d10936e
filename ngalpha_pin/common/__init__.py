"""What every package uses: checks of input, tolerances, files written whole, imports that are optional."""
