"""Encoder of pyramid textures: the model, and rate-distortion refinement of latents."""
