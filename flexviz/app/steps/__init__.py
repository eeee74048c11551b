"""The steps in the left dock, one file each: their controls, and what happens when they are used."""
