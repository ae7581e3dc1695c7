"""The module that `import smac` gets."""
