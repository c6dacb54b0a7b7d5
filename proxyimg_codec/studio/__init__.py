"""Studio: a server on the loopback, and the page that it serves; see `README.md` beside this."""
