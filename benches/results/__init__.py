"""The results in docs/results.md: training the teams, and drawing the page from what was measured.

`runs` is the table of what is trained, `learners` by what. `train` (`just results-train`) does so,
`shares` (`just results-shares`) measures where the time goes; both write the CSV files in docs/results, which
`data` reads and writes. `page` (`just results`) draws the page from these files: `tables` writes the tables,
`charts` the curves. Only `charts` needs more than Python: matplotlib.
"""
