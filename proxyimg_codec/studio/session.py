"""Session: the one content that server and page work on, its jobs, events and autosave.

Contents are changed one after the other, in a thread of their own; drawing reads the content of the
moment in others. So the event loop never waits for work.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from ..errors import PxiError, UsageError
from ..io.files import write_atomically
from ..limits import Limits
from ..progress import heard
from ..render.cache import Cache
from .autosave import Folder
from .content import Content
from .describe import described
from .document import Document
from .failures import StaleError
from .failures import described as failure
from .jobs import Job
from .kept import recovered, written
from .pointing import Pointing

Change = Callable[[Content, Job], Content]
Event = tuple[str, Any]
T = TypeVar("T")

SOON = 0.3
"""Seconds from a change until it is saved in the folder of the session."""

LONG = 0.4
"""Seconds after which pages are told of work that goes on."""

QUEUE_MAX = 256
"""Most events that a page has not taken."""


class Session:
    """The session of a server.

    Args:
        folder: Folder of the session.
        limits: Bounds on what files may ask for.
        jobs: Threads that work may use.
        path: Absolute path of the file that the server was started with, or None.
        port: Port of the server, by which others know that it is alive.

    Attributes:
        folder: Folder of the session.
        limits: Bounds on what files may ask for.
        jobs: Threads that work may use.
        path: Path of the file that the server was started with, or None.
        content: The content of the moment.
        version: Number that grows with every change.
        cache: Colours that were computed.
    """

    def __init__(
        self, folder: Folder, limits: Limits, jobs: int, path: Path | None = None, port: int = 0
    ) -> None:
        self.folder, self.limits, self.jobs, self.path = folder, limits, jobs, path
        self.content, self.version, self.cache = Content(), 0, Cache()
        self._port, self._prefix = port, secrets.token_hex(3)
        self._running: dict[int, Job] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._numbers: dict[int, tuple[Any, int]] = {}
        self._facts = described(self.content, self._numbers, self._prefix)
        self._saved: Document | None = None
        self._written: Path | None = None
        self._listeners: set[asyncio.Queue[Event]] = set()
        self._lock, self._writing, self._closed = asyncio.Lock(), threading.Lock(), False
        self._one = ThreadPoolExecutor(1, "pxi-change")
        self._many = ThreadPoolExecutor(2, "pxi-draw")
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self) -> None:
        """Begins to keep what changes; called in the event loop."""
        self._loop = asyncio.get_running_loop()
        self._keep(self._saving())
        pointing = self.content.pointing
        if self.content.stage == "pointing" and pointing is not None and not pointing.found:
            self.begin_find()

    async def stop(self) -> None:
        """Cancels all work, and keeps what is not saved."""
        self.cancel()
        self.publish("bye", {"reason": "the server stops"})
        for task in [*self._tasks]:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.to_thread(self._one.shutdown)
        await asyncio.to_thread(self._many.shutdown)
        await asyncio.to_thread(self._close)

    def _close(self) -> None:
        """Keeps what is not saved, or removes the folder; nothing is written after that."""
        if not self.saved:
            self.write()
        with self._writing:
            self._closed = True
            if self.saved:
                self.folder.remove()

    @property
    def target(self) -> Path | None:
        """Path that saving writes to; None if nothing was opened by a path."""
        path = self.content.path
        return None if path is None else Path(path).with_suffix(".pxi")

    @property
    def saved(self) -> bool:
        """Whether there is nothing that closing would lose."""
        document = self.content.document
        if document is None:
            return not self.content.past
        last = self._saved
        return last is not None and last.last is document.last and last.at == document.at

    def state(self) -> dict[str, Any]:
        """The state as JSON values, see `README.md`."""
        busy = next((job.described() for job in reversed(self._running.values())), None)
        target = None if self.target is None else self.target.name
        return {
            "version": self.version, **self._facts, "saved": self.saved, "target": target,
            "busy": busy, "files": self.folder.names(),
        }  # fmt: skip

    # Work

    async def change(self, kind: str, work: Change, version: int | None = None) -> None:
        """Changes the content, after the changes that are going on.

        Args:
            kind: Name of what is done.
            work: Function from a content and its job to the new content; called in a thread.
            version: Number of the state that the request was made for, or None for any.

        Raises:
            PxiError: The work failed, was cancelled, or the state is another one.
        """
        await self._change(Job(kind, self._tell), work, version)

    async def _change(self, job: Job, work: Change, version: int | None = None) -> None:
        self._running[job.number] = job
        late = asyncio.get_running_loop().call_later(LONG, self.publish_state)
        try:
            async with self._lock:
                if version is not None and version != self.version:
                    raise StaleError(
                        f"the state is {self.version} by now, not {version}; ask for it again"
                    )
                before = self.content
                self.content = await self._in(self._one, lambda: self._worked(work, job))
                self.version += 1
        finally:
            late.cancel()
            del self._running[job.number]
            self.publish_state()
        if self.content.stage == "pointing" and self.content.is_new(before):
            self.begin_find()

    def _worked(self, work: Change, job: Job) -> Content:
        with heard(lambda amount: job.check()):
            after = work(self.content, job)
            job.check()
        self._facts = described(after, self._numbers, self._prefix)
        return after

    def begin(self, kind: str, work: Callable[[Job], Awaitable[Any]]) -> int:
        """Begins work that goes on after the request; its end is told as event ``job-end``.

        Args:
            kind: Name of what is done.
            work: Coroutine function of the job, whose result is told.

        Returns:
            Number of the job.
        """
        job = Job(kind, self._tell)

        async def run() -> None:
            facts: dict[str, Any] = {"id": job.number, "kind": kind}
            try:
                result = await work(job)
                self.publish("job-end", facts | {"ok": True, "error": None, "result": result})
            except Exception as error:  # whatever it is, the page has to hear that this ended
                if not isinstance(error, PxiError):
                    logging.getLogger(__name__).exception("%s failed", kind)
                told = failure(error)[1]
                self.publish("job-end", facts | {"ok": False, "error": told, "result": None})

        self._keep(run())
        return job.number

    def begin_change(
        self, kind: str, work: Change, result: Callable[[Content], Any] = lambda content: None
    ) -> int:
        """Begins a change of the content that goes on after the request, as `begin`."""

        async def run(job: Job) -> Any:
            await self._change(job, work)
            return result(self.content)

        return self.begin(kind, run)

    def begin_find(self) -> None:
        """Begins to find the regions of a raster that was opened."""

        async def run(job: Job) -> None:
            await self._change(job, lambda content, job: content.first_found(self.jobs))
            pointing = self.content.pointing
            if pointing is not None:
                self._keep(self._prepared(pointing))

        self.begin("find", run)

    async def _prepared(self, pointing: Pointing) -> None:
        """Makes ready what the first click needs; it says itself why it fails."""
        with contextlib.suppress(PxiError):
            await self.read(lambda: pointing.prepare(self.jobs))

    async def read(self, work: Callable[[], T], job: Job | None = None) -> T:
        """Runs work that changes nothing in a thread.

        Args:
            work: The work.
            job: Its job, if the page is to see it and may cancel it.

        Raises:
            PxiError: The work failed.
        """
        if job is not None:
            self._running[job.number] = job
        try:
            return await self._in(self._many, work)
        finally:
            if job is not None:
                del self._running[job.number]

    async def _in(self, pool: ThreadPoolExecutor, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(pool, work)

    def cancel(self) -> None:
        """Lets all jobs end."""
        for job in self._running.values():
            job.cancel()

    def _keep(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def begin_with(self, content: Content, path: str) -> None:
        """Takes the content of a file that the server was started with.

        Args:
            content: The content.
            path: Absolute path of the file.
        """
        self.content = replace(content, path=path)
        self._facts = described(self.content, self._numbers, self._prefix)
        if path.lower().endswith(".pxi"):
            self.mark_saved()

    # Events

    def listen(self) -> asyncio.Queue[Event]:
        """Queue of events from now on, which begins with the state."""
        queue: asyncio.Queue[Event] = asyncio.Queue(QUEUE_MAX)
        queue.put_nowait(("state", self.state()))
        self._listeners.add(queue)
        return queue

    def unlisten(self, queue: asyncio.Queue[Event]) -> int:
        """Ends a queue of events; returns how many are left."""
        self._listeners.discard(queue)
        return len(self._listeners)

    @property
    def watched(self) -> bool:
        """Whether a page is open."""
        return bool(self._listeners)

    def publish(self, name: str, data: Any) -> None:
        """Tells all pages of an event; what a slow one has not taken goes, oldest first."""
        for queue in self._listeners:
            if queue.full():
                queue.get_nowait()
            queue.put_nowait((name, data))

    def publish_state(self) -> None:
        """Tells all pages of the state."""
        self.publish("state", self.state())

    def publish_from_thread(self, name: str, data: Any) -> None:
        """Tells all pages of an event; may be called in any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self.publish, name, data)

    def _tell(self, job: Job) -> None:
        self.publish_from_thread("job", job.described())

    # Saving

    async def save(self, replace_other: bool) -> None:
        """Writes the document to the target.

        Raises:
            PxiError: There is no document or target, it exists, or it cannot be written.
        """
        target = self.target
        document = self.content.edited
        if target is None:
            raise UsageError("this picture was not opened by a path; export it as .pxi instead")
        ours = target in (self._written, Path(self.content.path or ""))
        if target.exists() and not (replace_other or ours):
            raise UsageError(f"{target.name} exists already; save again to replace it")
        data = await self.read(document.to_bytes)
        await self.read(lambda: write_atomically(target, data))
        self._saved, self._written = document, target
        self.version += 1
        self.publish_state()

    def mark_saved(self) -> None:
        """Notes that the file on disk has the present document: it was read from there."""
        self._saved = self.content.document
        self.publish_state()

    def write(self) -> None:
        """Writes the content to the folder of the session."""
        path = None if self.path is None else str(self.path)
        with self._writing:
            if not self._closed:
                written(self.folder, self.content, {"path": path, "port": self._port})

    def recover(self) -> bool:
        """Takes the content from the folder of the session; returns whether there was one."""
        content = recovered(self.folder, self.limits)
        if content is None:
            return False
        self.content = replace(content, recovered=True)
        self._facts = described(self.content, self._numbers, self._prefix)
        return True

    async def _saving(self) -> None:
        """Writes the content to the folder soon after each change."""
        last: Content | None = None
        while True:
            await asyncio.sleep(SOON)
            content = self.content
            if content is last or (last is None and content.stage == "empty"):
                continue
            try:
                await asyncio.to_thread(self.write)
                last = content
            except PxiError as error:
                self.publish("warning", {"message": f"autosave: {error}"})
                last = content
