"""Other simulators as lines of the report, each built from the same `Scene`; they need the extra `bench`."""
