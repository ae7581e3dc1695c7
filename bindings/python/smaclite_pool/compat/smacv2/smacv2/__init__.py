"""The module that `import smacv2` gets."""

from . import env

__all__ = ["env"]
