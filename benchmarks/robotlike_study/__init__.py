"""Study of the diagnosis on simulated robots with many hidden effects at once, as real robots have them."""
