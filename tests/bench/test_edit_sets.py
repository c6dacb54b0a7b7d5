"""Sets of edits: layouts, the miniature, and networks that judge."""

import json

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from proxyimg_codec.bench.paper import edit_sets, editing, judges, miniature
from proxyimg_codec.bench.paper.items import Given
from proxyimg_codec.errors import InputError
from proxyimg_codec.io import raster
from tests.support.paper import TINY, rows_of
from tests.support.pictures import disc, smooth


@pytest.fixture
def drawn(data):
    """The data folder with a sprite."""
    (data / "clipart").mkdir()
    inside = 255 * disc(33, 29)[..., None].astype(np.uint8)
    raster.write(data / "clipart" / "ball.png", np.dstack([255 - smooth(33, 29), inside]))
    return data


def humanedit(folder, kind="Remove", **more):
    """A folder in the layout of HumanEdit with one edit."""
    (folder / "scripts").mkdir(parents=True)
    before = smooth(40, 32)
    after = before.copy()
    after[disc(40, 32)] = (100, 110, 120)
    mask = np.repeat(255 * disc(40, 32)[..., None].astype(np.uint8), 3, 2)
    row = {"IMAGE_ID": "one", "EDITING_TYPE": kind, "OUTPUT_DESCRIPTION": "a field"}
    for column, pixels in (("INPUT_IMG", before), ("MASK_IMG", mask), ("OUTPUT_IMG", after)):
        row[column] = f"{column}.png"
        raster.write(folder / row[column], pixels)
    lines = [row | more, row | {"IMAGE_ID": "without a script"}]
    (folder / "metadata.jsonl").write_text("".join(json.dumps(r) + "\n" for r in lines))
    script = {"version": 1, "edits": [{"op": "remove", "layer": "object"}]}
    (folder / "scripts" / "one.json").write_text(json.dumps(script))
    return before, after


def test_humanedit(tmp_path):
    before, after = humanedit(tmp_path / "h", OUTPUT_CAPTION_BY_LLAMA="meadow")
    (case,) = edit_sets.humanedit(tmp_path / "h")
    assert (case.source, case.name, case.kind, case.prompt) == (
        "HumanEdit", "one", "Remove", "meadow",
    )  # fmt: skip
    assert (case.before == before).all()
    assert (case.after == after).all()
    assert [r.name for r in case.masks] == ["object"]
    assert (case.masks[0].mask == disc(40, 32)).all()
    assert [e["op"] for e in case.edits] == ["remove"]


def test_masks_of_the_user_replace_the_published_one(tmp_path):
    humanedit(tmp_path / "h")
    (tmp_path / "h/masks/one").mkdir(parents=True)
    for k in (1, 2):
        part = np.zeros((32, 40, 3), np.uint8)
        part[:, 12 * k : 12 * k + 8] = 255
        raster.write(tmp_path / f"h/masks/one/{k} part{k}.png", part)
    (case,) = edit_sets.humanedit(tmp_path / "h")
    assert [r.name for r in case.masks] == ["part1", "part2"]


def test_clear_places_are_marked_if_there_are_any(tmp_path):
    rgba = np.full((32, 40, 4), 255, np.uint8)
    rgba[disc(40, 32), 3] = 0
    humanedit(tmp_path / "h")
    raster.write(tmp_path / "h" / "MASK_IMG.png", rgba)
    (case,) = edit_sets.humanedit(tmp_path / "h")
    assert (case.changed == disc(40, 32)).all()


def test_oir_bench(tmp_path):
    yaml = pytest.importorskip("yaml")
    folder = tmp_path / "oir-bench"
    (folder / "multi_object/dataset").mkdir(parents=True)
    (folder / "multi_object/mask/m1").mkdir(parents=True)
    (folder / "scripts").mkdir()
    raster.write(folder / "multi_object/dataset/m1.png", smooth(40, 32))
    mask = np.repeat(255 * disc(40, 32)[..., None].astype(np.uint8), 3, 2)
    raster.write(folder / "multi_object/mask/m1/bowl.png", mask)
    entry = {
        "image_path": "OIR-Bench/multi_object/dataset/m1.png", "target_prompt": "a red bowl",
        "prompt_change_mask": ["OIR-Bench/multi_object/mask/m1/bowl.png"],
    }  # fmt: skip
    (folder / "multi_object.yaml").write_text(yaml.safe_dump({"m1": entry}))
    single = {
        "image_path": "/home/x/OIR-Bench/multi_object/dataset/m1.png",
        "origin_prompt_mask": "/home/x/OIR-Bench/multi_object/mask/m1/bowl.png",
        "target_prompt_list": ["a ", " on a table"], "target_changes": ["plate", "cup"],
    }  # fmt: skip
    (folder / "single_object.yaml").write_text(yaml.safe_dump({"s": single}))
    script = {"version": 1, "edits": [{"op": "recolour", "layer": "bowl", "hue": 90}]}
    (folder / "scripts/m1.json").write_text(json.dumps(script))
    multi, one = edit_sets.oir_bench(folder)
    assert (multi.kind, multi.prompt, multi.after) == ("multi object", "a red bowl", None)
    assert (one.kind, one.prompt) == ("single object", "a plate on a table")
    assert [r.name for r in multi.masks] == ["bowl"]
    (row, *_) = editing._measure(multi.before, {}, case=multi, weights={}, effort=1)
    assert "l1" not in row
    assert row["outside"] < 0.1


def test_what_is_wrong_with_a_set_is_said(tmp_path):
    (tmp_path / "h").mkdir()
    with pytest.raises(InputError, match="nor Parquet files"):
        edit_sets.humanedit(tmp_path / "h")
    humanedit(tmp_path / "g", INPUT_IMG="nowhere.png")
    with pytest.raises(InputError, match=r"nowhere\.png"):
        edit_sets.humanedit(tmp_path / "g")
    (tmp_path / "g/nowhere.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot be read"):
        edit_sets.humanedit(tmp_path / "g")
    (tmp_path / "g/metadata.jsonl").write_text("{")
    with pytest.raises(InputError, match="no JSON"):
        edit_sets.humanedit(tmp_path / "g")


def test_the_miniature_has_true_results(drawn, tmp_path):
    miniature.write(Given(drawn), TINY, tmp_path / "m")
    cases = {c.kind: c for c in edit_sets.humanedit(tmp_path / "m", "miniature")}
    assert set(cases) == {"Add", "Remove", "Counting", "Relation"}
    photo = cases["Add"].before
    assert (cases["Remove"].after == photo).all()
    assert (cases["Remove"].before == cases["Add"].after).all()
    one, both, other = (cases[k].after for k in ("Add", "Counting", "Relation"))
    union = (one != photo).any(2) | (other != photo).any(2)
    assert ((both != photo).any(2) == union).all()
    assert (other[cases["Relation"].changed] == photo[cases["Relation"].changed]).mean() > 0.9


def test_editing_from_pictures_to_a_report(tool, drawn, tmp_path, here):
    humanedit(drawn / "humanedit")
    out = tmp_path / "out"
    tool("bench", "paper", "--data", drawn, "--out", out, "--quick", "--only", "editing")
    rows = rows_of(out, "editing")
    by = {(r["set"], r["edit"], r["method"]): r for r in rows}
    assert len(by) == 5 * 3
    for (source, kind, method), row in by.items():
        if method == "pxi" and source == "miniature":
            assert row["l2"] < 0.5 * by[source, kind, "unchanged"]["l2"], kind
            assert row["outside"] < 0.05
    text = (out / "report.md").read_text()
    assert "no weights were given (`--weights`): CLIP-I, CLIP-T, DINO, LPIPS." in text
    assert "the data folder does not hold them: OIR-Bench." in text


def test_scripts_that_fail_are_named(tmp_path):
    humanedit(tmp_path / "h")
    script = {"version": 1, "edits": [{"op": "remove", "layer": "nobody"}]}
    (tmp_path / "h/scripts/one.json").write_text(json.dumps(script))
    (case,) = edit_sets.humanedit(tmp_path / "h")
    with pytest.raises(InputError, match=r"script of one: .*nobody"):
        editing._measure(case.before, {}, case=case, weights={}, effort=1)


def distance_model(path):
    """ONNX file of the mean absolute difference of two pictures."""
    shape = [1, 3, "h", "w"]
    a, b = (helper.make_tensor_value_info(n, TensorProto.FLOAT, shape) for n in "ab")
    out = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 1, 1, 1])
    nodes = [
        helper.make_node("Sub", ["a", "b"], ["d"]), helper.make_node("Abs", ["d"], ["m"]),
        helper.make_node("ReduceMean", ["m"], ["out"], axes=[1, 2, 3]),
    ]  # fmt: skip
    graph = helper.make_graph(nodes, "g", [a, b], [out])
    opsets = [helper.make_opsetid("", 13)]
    onnx.save(helper.make_model(graph, opset_imports=opsets, ir_version=8), path)


def test_lpips_is_measured_with_a_file(tmp_path):
    distance_model(tmp_path / "d.onnx")
    one = smooth(40, 32)
    found = judges.judged({"lpips": tmp_path / "d.onnx"}, one, 255 - one, "")
    want = np.abs(2 * one.astype(float) - 255).mean() / 127.5
    assert found == {"lpips": pytest.approx(want, abs=1e-4)}
    assert judges.judged({"lpips": tmp_path / "d.onnx"}, one, None, "words") == {}
    (tmp_path / "x.onnx").write_bytes(b"nothing")
    with pytest.raises(InputError, match="no ONNX file"):
        judges.judged({"lpips": tmp_path / "x.onnx"}, one, one, "")


def test_weights_that_are_wrong_are_refused(tool, data, tmp_path):
    words = ("bench", "paper", "--data", data, "--out", tmp_path / "out", "--weights")
    assert "clip, dino, lpips" in tool(*words, "vgg=x", code=2).err
    assert "does not exist" in tool(*words, "dino=nowhere", code=3).err


def test_clip_and_dino_are_folders_of_transformers(tmp_path):
    """Small models of random weights: what is alike is 1, what differs less, and words count."""
    t = pytest.importorskip("transformers")
    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1,
             "num_attention_heads": 2}  # fmt: skip
    seen = {**small, "image_size": 32, "patch_size": 16}
    letters = [c + end for end in ("", "</w>") for c in "acdefghot "]
    vocabulary = {w: k for k, w in enumerate([*letters, "<|startoftext|>", "<|endoftext|>"])}
    words = {**small, "vocab_size": len(vocabulary), "bos_token_id": 20, "eos_token_id": 21}
    clip, dino = tmp_path / "clip", tmp_path / "dino"
    config = t.CLIPConfig(text_config=words, vision_config=seen, projection_dim=8)
    t.CLIPModel(config).save_pretrained(clip)
    crop = {"height": 32, "width": 32}
    t.CLIPImageProcessor(size={"shortest_edge": 32}, crop_size=crop).save_pretrained(clip)
    (clip / "vocab.json").write_text(json.dumps(vocabulary))
    (clip / "merges.txt").write_text("#version: 0.2\n")
    (clip / "tokenizer_config.json").write_text('{"tokenizer_class": "CLIPTokenizer"}')
    t.ViTModel(t.ViTConfig(**seen)).save_pretrained(dino)
    t.ViTImageProcessor(size=crop).save_pretrained(dino)
    one, weights = smooth(50, 40), {"clip": clip, "dino": dino}
    same = judges.judged(weights, one, one, "a cat")
    assert (same["clip_i"], same["dino"]) == (1, 1)
    assert -1 <= same["clip_t"] < 1
    other = judges.judged(weights, one, 255 - one, "a dog")
    assert other["clip_i"] < 1 > other["dino"]
    assert other["clip_t"] != same["clip_t"]
