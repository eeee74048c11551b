"""The study of the diagnosis: simulated robots with something hidden in them, and what it says of them."""
