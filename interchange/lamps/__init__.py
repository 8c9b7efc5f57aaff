"""Lamps of machine vision, built from ``Light`` records: one file a kind of device."""
