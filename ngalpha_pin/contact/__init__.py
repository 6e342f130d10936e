"""Contacts as arrays: rows to second order, index sets and laws."""
