"""The command `ngalpha-pin`."""
