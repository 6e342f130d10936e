"""What must vanish in a step, (127)-(142), its Newton matrix, and their sparse and compiled twins."""
