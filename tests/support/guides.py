"""Guides that are exact: score distillation by mixtures of Gaussians, whose score is known."""

import torch

from proxyimg_codec.generate.pixel_guide import PixelGuide, angles

SIDE = 16


class Mixture:
    """Mixture of Gaussians of pictures of one colour, with the same deviation, as a denoiser.

    Args:
        modes: Colours [K, 3] in 0..1.
        wanted: Number of the mode that the prompt means.
        deviation: Standard deviation of a sample, in -1..1.
    """

    def __init__(self, modes, wanted, deviation=0.1):
        self.modes = 2 * torch.tensor(modes, dtype=torch.float64) - 1
        self.wanted, self.deviation = wanted, deviation

    def log_density(self, x, times, prompted):
        """Logarithm of the density of noisy pictures [B, 3, S, S], up to a constant."""
        cos, sin = angles(times)
        variance = (cos * self.deviation) ** 2 + sin**2
        modes = self.modes[self.wanted : self.wanted + 1] if prompted else self.modes
        away = x[:, None] - cos[:, None] * modes.to(x)[None, :, :, None, None]
        return torch.logsumexp(-0.5 * (away**2).sum((2, 3, 4)) / variance[:, :, 0, 0], 1)

    def noise(self, x, times, prompted):
        """Noise in x: the score times minus its standard deviation, by the formula."""
        cos, sin = angles(times)
        variance = (cos * self.deviation) ** 2 + sin**2
        modes = self.modes[self.wanted : self.wanted + 1] if prompted else self.modes
        away = x[:, None] - cos[:, None] * modes.to(x)[None, :, :, None, None]
        exponent = -0.5 * (away**2).sum((2, 3, 4)) / variance[:, :, 0, 0]
        share = torch.softmax(exponent, 1)[:, :, None, None, None]
        return sin * (share * away).sum(1) / variance


def mixture_guide(modes, wanted, guidance=1.0, weighting="sds"):
    """A guide of a mixture."""
    return PixelGuide(Mixture(modes, wanted).noise, SIDE, guidance, weighting)
