"""Everything around the served package: training, evaluation, data preparation, body baking, load.

`wayfarer` never imports this package (a contract in pyproject.toml says so).
"""

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported
