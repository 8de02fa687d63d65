"""gRPC, HTTP and WebSocket: thin servers over one `Gateway`."""
