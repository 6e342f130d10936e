"""What a run can start from."""
