"""The `mapforest` program: one module a command."""
