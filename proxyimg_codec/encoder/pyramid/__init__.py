"""Encoder of pyramid textures: the model in torch, and rate-distortion refinement of latents."""

from ..yielding import torch as torch
