"""What the user declares; nothing is computed."""
