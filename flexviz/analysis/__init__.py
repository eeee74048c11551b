"""What is computed from a measurement set: estimation, identification, diagnosis, design, acceptance."""
