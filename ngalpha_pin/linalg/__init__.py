"""Matrices and spatial algebra."""
