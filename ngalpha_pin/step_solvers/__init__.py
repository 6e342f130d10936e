"""How R(x) = 0 of a step is solved: a cascade, one solver a file."""
