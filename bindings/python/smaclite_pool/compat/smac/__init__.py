"""The replacement for the package `smac`; `smaclite_pool.compat` puts it on the path."""
