"""Requests that change the regions of a raster."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .content import Content
from .failures import MissingError
from .jobs import Job
from .requests import hints_of, radius_of, strokes_of
from .session import Change

Values = Mapping[str, Any]


def searched(jobs: int, count: int) -> Change:
    """Change that finds regions anew."""
    return lambda content, job: content.with_regions(content.pointed.searched(count, jobs))


def changed(action: str, values: Values, jobs: int) -> Change:
    """Change of regions that a request asks for.

    Raises:
        UsageError: The request is not understood.
    """

    def work(content: Content, job: Job) -> Content:
        if action == "undo":
            return content.regions_undone()
        if action == "redo":
            return content.regions_redone()
        if action == "reopen":
            return content.reopened()
        pointing = content.pointed
        name, size = values.get("name"), pointing.size
        if action == "point":
            return content.with_regions(pointing.pointed(name, hints_of(values, size), jobs))
        if action == "split":
            hints, to = hints_of(values, size), values.get("to")
            return content.with_regions(pointing.split(str(name), hints, to, jobs))
        if action == "paint":
            erase = values.get("erase") is True
            changed = pointing.painted(str(name), strokes_of(values), radius_of(values), erase)
            return content.with_regions(changed)
        if action == "rename":
            return content.with_regions(pointing.renamed(str(name), str(values.get("to"))))
        if action == "remove":
            return content.with_regions(pointing.removed(str(name)))
        if action == "merge":
            return content.with_regions(pointing.merged(str(name), str(values.get("other"))))
        if action == "order" and isinstance(values.get("to"), int):
            return content.with_regions(pointing.ordered(str(name), values["to"]))
        raise MissingError(f"regions/{action}: there is no such request, or `to` is missing")

    return work
