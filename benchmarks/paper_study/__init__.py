"""The paper's simulation study: groups A–F, every method against the truth, and the bound nobody can beat."""
