"""The messages of the API as validated values: field for field those of `proto/wayfarer/v1`.

HTTP reads and writes them as JSON; gRPC converts them generically (wire.py). Ranges that need
no other knowledge are checked here, for both transports; the rest is checked in the gateway.
Lengths, places, headings are in the basis of the session unless a name ends in `_m`.
"""

from wayfarer.config.limits import Limits
from wayfarer.transport.schema.base import *
from wayfarer.transport.schema.messages import *
from wayfarer.transport.schema.only_http import *
