"""Around the calls: connections, TLS, guards, rates, origins, figures and spans."""
