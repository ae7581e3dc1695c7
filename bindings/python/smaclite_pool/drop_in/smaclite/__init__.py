"""What `import smaclite` gets when this folder's parent is on the path before the published package."""

from smaclite_pool.drop_in import register

register()
