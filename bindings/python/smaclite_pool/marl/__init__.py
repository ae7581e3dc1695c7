"""Interfaces of MARL code bases: SMAC and PyMARL, EPyMARL, and on-policy."""
