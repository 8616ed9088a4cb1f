"""The server of an FMU for importers elsewhere: `vibroimpact fmu serve`.

`server` answers calls of gRPC. `process` is the process of one instance, as the server sees it. `child` runs there; it
makes the calls of the FMU by `calls`.
"""
