import pytest

from proxyimg_codec.encoder.shapes.external_models import segmenters
from proxyimg_codec.encoder.shapes.external_models.kinds import Kind, kind_of
from proxyimg_codec.encoder.shapes.onnx_model import load
from proxyimg_codec.errors import InputError
from tests.support import onnx_models
from tests.support.pictures import smooth

KINDS = [
    (onnx_models.sam_encoder, Kind.SAM_ENCODER),
    (lambda: onnx_models.sam_encoder(rows=True), Kind.SAM_ENCODER),
    (onnx_models.sam_decoder, Kind.SAM_DECODER),
    (onnx_models.efficient_encoder, Kind.EFFICIENT_ENCODER),
    (onnx_models.efficient_decoder, Kind.EFFICIENT_DECODER),
    (onnx_models.efficient, Kind.EFFICIENT),
    (onnx_models.sam2_encoder, Kind.SAM2_ENCODER),
    (onnx_models.sam2_decoder, Kind.SAM2_DECODER),
    (onnx_models.figures, Kind.U2NET),
    (lambda: onnx_models.figures(1024), Kind.ISNET),
    (onnx_models.depth, Kind.DEPTH),
    (lambda: onnx_models.depth("518", "518", four=True), Kind.DEPTH),
    (onnx_models.inpainting, Kind.INPAINTING),
    (lambda: onnx_models.inpainting("512, 512", 255), Kind.INPAINTING),
]


@pytest.mark.parametrize(("made", "kind"), KINDS)
def test_kinds_are_recognized_by_their_tensors(tmp_path, made, kind):
    assert kind_of(load(onnx_models.write(tmp_path / "m.onnx", made()))) is kind


OTHERS = [
    "agraph (float[1, 10] x) => (float[1, 10] y) { y = Identity(x) }",
    "agraph (float[1, 4, 8, 8] x) => (float[1, 4, 8, 8] y) { y = Identity(x) }",
    "agraph (int64[1, 3, 8, 8] x) => (int64[1, 3, 8, 8] y) { y = Identity(x) }",
    "agraph (float[1, 3, 8, 8] x, float[1, 3, 8, 8] m) => (float[1, 3, 8, 8] y) { y = Add(x, m) }",
    "agraph (float[1, 3, 8, 8] x, float[1, 1, 8, 8] m) => (float[1, 1, 8, 8] y) { y = Abs(m) }",
    """agraph (float[1, 256, 64, 64] image_embeddings, float[1, n, 2] point_coords,
        float[1, n] point_labels, float[1] mood) => (float[1] masks, float[1] iou_predictions) {
        masks = Identity(mood) iou_predictions = Identity(mood) }""",
]


@pytest.mark.parametrize("text", OTHERS)
def test_others_are_explained(tmp_path, text):
    path = onnx_models.write(tmp_path / "m.onnx", onnx_models.model(text))
    with pytest.raises(InputError) as caught:
        segmenters.find_segmenter(str(path))(smooth(48, 40), 4, None)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "point_coords, point_labels, mask_input" in message
    assert ("mood float32 [1]" if "mood" in text else "inputs x ") in message


def test_a_model_for_something_else_is_told(tmp_path):
    depth = onnx_models.write(tmp_path / "d.onnx", onnx_models.depth())
    figure = onnx_models.write(tmp_path / "f.onnx", onnx_models.figures())
    lama = onnx_models.write(tmp_path / "l.onnx", onnx_models.inpainting())
    for path, flag in ((depth, "depth"), (lama, "background")):
        with pytest.raises(InputError, match=f"finds no layers; give it to --{flag}"):
            segmenters.find_segmenter(str(path))(smooth(48, 40), 4, None)
    with pytest.raises(InputError, match=r"kind figures, as U²-Net .* needs relative depth"):
        segmenters.find_depth(str(figure))(smooth(48, 40))
