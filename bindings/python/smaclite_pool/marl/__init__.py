"""Interfaces of MARL code bases: SMAC and PyMARL, SMACv2, EPyMARL, and on-policy."""
