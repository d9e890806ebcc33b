"""Send HTTP requests: clients, connections, deadlines, raw sockets, recorded exchanges."""
