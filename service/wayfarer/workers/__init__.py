"""Several workers on one machine: their supervisor, and the front that relays calls to them."""
