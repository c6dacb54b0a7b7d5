"""Several inputs into one folder: in processes of this machine, or on a cluster.

`each` takes a command line apart, `run` has a job done for each input by a pool of workers, and
`work` is what a worker does. `records` say what is done, so that nothing is done twice.
"""
