"""Robots: descriptions and what is wrong with them, mounting, the parameters of a flexible-joint model."""
