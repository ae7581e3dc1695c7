"""What `import smac` gets when this folder is on the path before the published package."""

from smaclite_pool.smac import install

install()
