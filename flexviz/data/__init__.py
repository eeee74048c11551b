"""Measurement sets: reading, checking and writing them, import of other logs, noise of the samples."""
