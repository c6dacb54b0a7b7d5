"""The package's decoder passes the suite without its compiled kernel."""

import pytest

from conformance import runner
from proxyimg_codec.native import kernel
from tests.conformance.decoders import CASES, in_process, own_latents, problems


@pytest.fixture(scope="module", autouse=True)
def no_kernel():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PROXYIMG_NO_KERNEL", "1")
        kernel.library.cache_clear()
        yield
    kernel.library.cache_clear()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_package_decodes_without_its_kernel(case):
    assert not kernel.available()
    assert problems(runner.run([case], in_process, digester=own_latents)) == []
