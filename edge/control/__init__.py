"""The recorder's control socket: message types and client. All that the user interface knows of the recorder."""
