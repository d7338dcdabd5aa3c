"""One recording opened by programs that are not ours."""
