"""What lies where a layer is hidden by those in front of it."""
