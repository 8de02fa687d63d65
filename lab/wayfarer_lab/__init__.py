"""Everything around the served package: training, evaluation, data preparation, body baking, load.

`wayfarer` never imports this package (a contract in pyproject.toml says so).
"""
