"""Broad phase, narrow phase, clipping and manifolds; only here coal is asked for distances."""
