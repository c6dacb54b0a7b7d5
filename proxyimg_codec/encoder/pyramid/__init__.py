"""Encoder of pyramid textures: the model in torch, and rate-distortion refinement of latents."""
