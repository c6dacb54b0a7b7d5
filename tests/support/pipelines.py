"""Tiny pipelines of diffusers with random weights, and a local tokenizer."""

import json

import torch


def write(folder, kind="1", prediction="epsilon", seed=0):
    """Writes a pipeline like Stable Diffusion: of ``1``, or ``xl`` with two text encoders."""
    from diffusers import (
        AutoencoderKL,
        DDIMScheduler,
        StableDiffusionPipeline,
        StableDiffusionXLPipeline,
        UNet2DConditionModel,
    )

    torch.manual_seed(seed)
    vae = AutoencoderKL(
        in_channels=3, out_channels=3, latent_channels=4, sample_size=16,
        down_block_types=["DownEncoderBlock2D"] * 2, up_block_types=["UpDecoderBlock2D"] * 2,
        block_out_channels=[8, 8], norm_num_groups=4, layers_per_block=1, scaling_factor=0.3,
    )  # fmt: skip
    more = {}
    if kind == "xl":
        more = {
            "addition_embed_type": "text_time", "addition_time_embed_dim": 4,
            "projection_class_embeddings_input_dim": 6 * 4 + 16,
        }  # fmt: skip
    unet = UNet2DConditionModel(
        sample_size=8, in_channels=4, out_channels=4, layers_per_block=1,
        block_out_channels=[8, 16], norm_num_groups=4, attention_head_dim=4,
        down_block_types=["DownBlock2D", "CrossAttnDownBlock2D"],
        up_block_types=["CrossAttnUpBlock2D", "UpBlock2D"],
        cross_attention_dim=32 if kind == "xl" else 16, **more,
    )  # fmt: skip
    scheduler = DDIMScheduler(
        num_train_timesteps=1000, beta_start=0.00085, beta_end=0.012,
        beta_schedule="scaled_linear", prediction_type=prediction, clip_sample=False,
        steps_offset=1,
    )  # fmt: skip
    if kind == "xl":
        from transformers import CLIPTextModelWithProjection

        pipe = StableDiffusionXLPipeline(
            vae=vae, unet=unet, scheduler=scheduler, text_encoder=encoder(folder),
            text_encoder_2=encoder(folder, CLIPTextModelWithProjection),
            tokenizer=tokenizer(folder), tokenizer_2=tokenizer(folder), add_watermarker=False,
        )  # fmt: skip
    else:
        pipe = StableDiffusionPipeline(
            vae=vae, unet=unet, scheduler=scheduler, text_encoder=encoder(folder),
            tokenizer=tokenizer(folder), safety_checker=None, feature_extractor=None,
            requires_safety_checker=False,
        )  # fmt: skip
    pipe.save_pretrained(folder / "pipeline")
    return folder / "pipeline"


def encoder(folder, kind=None):
    """A text encoder with random weights."""
    from transformers import CLIPTextConfig, CLIPTextModel

    config = CLIPTextConfig(
        vocab_size=300, hidden_size=16, intermediate_size=24, num_hidden_layers=2,
        num_attention_heads=2, max_position_embeddings=20, projection_dim=16, bos_token_id=1,
        eos_token_id=2, pad_token_id=2,
    )  # fmt: skip
    return (kind or CLIPTextModel)(config).eval()


def tokenizer(folder):
    """A tokenizer whose tokens are letters."""
    from transformers import CLIPTokenizer

    letters = "abcdefghijklmnopqrstuvwxyz"
    words = ["<|startoftext|>", "<|endoftext|>", *letters, *(f"{c}</w>" for c in letters)]
    (folder / "vocab.json").write_text(
        json.dumps({"!": 0, **{w: k for k, w in enumerate(words, 1)}})
    )
    (folder / "merges.txt").write_text("#version: 0.2\n")
    return CLIPTokenizer(
        str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=20
    )
