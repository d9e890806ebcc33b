"""One request and its answer: exchange, client, deadlines, raw sockets."""
