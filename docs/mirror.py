"""A hook of MkDocs: the site mirrors the repository, so that links between pages hold in both."""

from __future__ import annotations

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

PATTERNS = (
    "[A-Z]*.md",
    "docs/**/*.md",
    "docs/images/**/*.*",
    "docs/*.json",
    "spec/*.md",
    "spec/example.pxi",
    "spec/registry.json",
    "conformance/README.md",
    "fuzz/README.md",
    "training/README.md",
    "web/README.md",
    "proxyimg_codec/models/*.md",
    "proxyimg_codec/animate/*.json",
)
"""What the site consists of: pages, and files that they show or link to."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Takes pages from the whole repository, each under its path there."""
    root = Path(config.config_file_path).parent
    for file in list(files):
        if file.src_dir == config.docs_dir:
            files.remove(file)
    for pattern in PATTERNS:
        for path in sorted(root.glob(pattern)):
            name = path.relative_to(root).as_posix()
            files.append(File(name, str(root), config.site_dir, config.use_directory_urls))
    return files
