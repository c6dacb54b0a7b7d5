"""Rate–distortion benchmarks against other codecs; needs the ``bench`` extra."""
