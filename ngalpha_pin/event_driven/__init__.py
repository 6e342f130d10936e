"""Runs of chosen accuracy: smooth phases between located events."""
