"""New textures from words: score distillation on the texture of one layer."""
