"""The package of the environment, its wrapper, distributions and maps."""
