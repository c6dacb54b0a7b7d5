"""Short implementations of other representations of pictures, to compare with; they need torch."""
