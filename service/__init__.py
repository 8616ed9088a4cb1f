"""The orchestration service: campaigns that others submit over HTTP, kept and resumed after any interruption.

`commands` holds `vibroimpact serve`, and the client's `submit`, `status`, `fetch`, `cancel`; `client` is the client in
Python. The service itself needs the extra `service`.
"""
