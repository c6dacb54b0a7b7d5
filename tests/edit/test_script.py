import json
import subprocess
import sys

import pytest

from proxyimg_codec.edit import script
from tests.support.edits import BAD, FLAGS
from tests.support.paths import ROOT

jsonschema = pytest.importorskip("jsonschema")

PUBLISHED = ROOT / "docs" / "edits.schema.json"


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(PUBLISHED.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def test_the_published_schema_is_that_of_the_code():
    text = json.dumps(script.schema(), indent=2) + "\n"
    assert PUBLISHED.read_text() == text, "run python -m proxyimg_codec.edit.script"


@pytest.mark.parametrize("operation", [operation for _, operation in FLAGS])
def test_what_the_tool_does_satisfies_the_schema(validator, operation):
    validator.validate({"version": 1, "edits": [operation]})


def test_the_schema_refuses_what_has_the_wrong_shape(validator):
    shapeless = [v for v, said in BAD if said in ("dx, dy", "by is missing", "speed", "explode")]
    assert len(shapeless) >= 5
    for values in shapeless:
        if values.get("by", [0])[-1] == values.get("by", [0])[-1]:  # JSON has no NaN
            assert not validator.is_valid({"version": 1, "edits": [values]})
    assert not validator.is_valid({"edits": []})


def test_the_fuzz_target_knows_the_operations():
    code = "from fuzz import edit; assert len(edit.OPERATIONS) > 20"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, timeout=60)
