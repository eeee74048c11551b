"""Logs of robots: their formats, a mapping of their columns, and the groups that are assembled from both."""
