"""FMUs in another process or on another machine, by gRPC: the messages, and instances that call them.

`protocol` has messages and limits, which the server shares. `address` reads addresses and finds tokens, `channel` is
the only importer of gRPC. `description` takes an FMU's description from its server. `session` is one instance there,
`functions` are the functions of its FMU, `instances` the instances that an importer steps.
"""
