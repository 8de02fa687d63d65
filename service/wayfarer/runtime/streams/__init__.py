"""Publications with positions, held for those who resume; bounded subscriptions; events."""
