"""Products in the hands of programs that are not ours."""
