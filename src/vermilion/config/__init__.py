"""The configuration: one typed section a stage, unknown keys refused."""
