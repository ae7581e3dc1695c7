"""How far the battles of a rule set are from recorded battles of SMAC: `just realism [FOLDER]`.

README.md in this folder has the format of the recordings, their sources, and what is measured. `recordings`
reads them; `cast` says which unit is which; `pool` plays their steps, and `smax` in another environment;
`free` plays them from their starts, `restarted` from what is recorded every so often; `measures`, `walks` and
`stands` compare; `play` has random play and scripts; `tables` prints and writes."""
