"""The package of the environment and its maps."""
