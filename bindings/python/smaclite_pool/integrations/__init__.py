"""Interfaces of other frameworks, one module per framework; each imports only its own framework."""
