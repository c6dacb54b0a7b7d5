"""The encoder's side of the pyramid texture: the model in torch, and rate-distortion refinement."""
