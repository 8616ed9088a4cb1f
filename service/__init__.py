"""The orchestration service: campaigns that others submit over HTTP, kept and resumed through anything.

`commands` has `vibroimpact serve`, and the client's `submit`, `status`, `fetch`, `cancel`; `client` is the client of
Python. The service itself needs the extra `service`.
"""
