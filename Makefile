# `make demo`, `make quick`, `make test` and `make docs` set up .venv by themselves.
PYTHON ?= python3
BIN := .venv/bin
PHOTO := docs/images/photo.png

.PHONY: demo quick test docs bench clean

.venv/ready: pyproject.toml constraints.txt setup.py $(wildcard proxyimg_codec/native/*.cpp proxyimg_codec/native/*.h)
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet -c constraints.txt setuptools
	$(BIN)/pip install --quiet -c constraints.txt -e '.[dev]'
	touch $@

# Enough for `make quick`: what the decoder needs, unless everything is there.
.venv/light: pyproject.toml constraints.txt setup.py $(wildcard proxyimg_codec/native/*.cpp proxyimg_codec/native/*.h)
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet -c constraints.txt setuptools
	$(BIN)/pip install --quiet -c constraints.txt -e . pytest hypothesis
	touch $@

demo: .venv/ready
	@mkdir -p demo
	$(BIN)/pxi-encode $(PHOTO) demo/photo.pxi --force
	$(BIN)/pxi-decode demo/photo.pxi demo/photo.png --force
	$(BIN)/pxi-decode demo/photo.pxi demo/photo-2x.png --scale 2 --force
	@echo "Look at demo/photo.png and demo/photo-2x.png beside $(PHOTO)."

# A browser and a runtime for the tests of web/; without npm or a network these are skipped.
tests/web/node_modules/ready: tests/web/package.json
	-@command -v npm > /dev/null && timeout 300 npm install --silent --no-audit --no-fund --prefix tests/web && touch $@

# The format and its decoder, without encoding anything: less than a minute.
QUICK := $(addprefix tests/,entropy container geometry texture codec io test_golden.py)

quick: $(if $(wildcard .venv/ready),.venv/ready,.venv/light)
	$(BIN)/pytest $(QUICK) -q -m "not encoder and not browser and not data and not slow"

test: .venv/ready tests/web/node_modules/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache --no-logo
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder

# The documentation in site/, without a network. Warnings and links that lead nowhere are errors, unless
# --quiet hides them.
docs: .venv/ready
	PATH="$(CURDIR)/$(BIN):$$PATH" NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "Open site/index.html."

bench: .venv/ready
	$(BIN)/python -m benchmarks.figures $(DATA)

clean:
	rm -rf .venv tests/web/node_modules demo site build *.egg-info proxyimg_codec/native/_kernel*.so
