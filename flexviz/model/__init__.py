"""The model of a flexible-joint robot: effects, observers, equation of motion, compensation, simulation."""
