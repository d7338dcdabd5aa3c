"""Images and labels for training: what is chosen, how labels read, what may be used, how it is divided."""
