"""Sentences of facts, a file for each topic; every file here is found by itself (`wording.facts`)."""
