"""Publications and the subscriptions to them."""
