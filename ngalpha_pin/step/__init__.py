"""What must vanish in a step, (127)-(142), and how R(x) = 0 is solved: a cascade, one solver a file."""
