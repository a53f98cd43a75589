"""The subcommands of `vermilion`, a module each.

The first line of a module's docstring stands in the list of `vermilion --help`, the whole docstring is the
subcommand's help. A module has `add_arguments(parser)` and `run(arguments) -> int`, the exit status. With
`PASSES_ON = True`, what the parser does not know is in `arguments.options`, for Snakemake or a server.
Imports of what is slow to load stand in `run`, so that `--help` is quick.
"""
