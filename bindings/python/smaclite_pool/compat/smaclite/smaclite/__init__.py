"""The module that `import smaclite` gets."""

from smaclite_pool.compat.smaclite import register

register()
