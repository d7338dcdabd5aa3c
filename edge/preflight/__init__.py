"""What has to be right before a walk: small checks, each with what to do about it."""
