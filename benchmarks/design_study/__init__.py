"""Designed experiments against the paper's group B, and ties broken by a designed motion."""
