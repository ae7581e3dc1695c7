"""The results in docs/results.md: training the teams, and drawing the page from what was measured.

`train` (`just results-train`) trains and reports all teams, `shares`, `search`, `opponents` and `elo` measure
the rest, `zoo` keeps the best teams; `runs` compares the options of runs. They write the CSV files in
docs/results, which `data` reads and writes. `page` (`just results`) draws the page from these files: `tables`
writes the tables, `charts` the ratings, for which it needs matplotlib.
"""
