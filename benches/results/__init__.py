"""The results in docs/results.md: training the teams, and writing the page from what was measured.

`train` (`just results-train`) trains and reports all teams, `search` looks for the best episodes, `zoo` keeps
the best teams; `runs` compares the options of runs. They write the CSV files in docs/results, which `data`
reads and writes. `page` (`just generate`) writes the page from these files with `tables`; `charts` draws
those of `benchmarks`.
"""
