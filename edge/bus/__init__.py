"""What the recorder and the live pipeline tell each other, over ZeroMQ on local sockets."""
