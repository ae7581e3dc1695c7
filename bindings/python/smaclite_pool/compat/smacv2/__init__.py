"""The replacement for the package `smacv2`; `smaclite_pool.compat` puts it on the path."""
