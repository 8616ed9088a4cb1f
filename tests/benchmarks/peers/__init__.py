"""The study of `vibroimpact accuracy` for other people's solvers, on six problems whose references are confirmed.

| module | idea |
|---|---|
| `problems` | the six problems, as scenes of ours and as the linear pieces that a peer integrates |
| `references` | what errors are measured against, and the independent road that confirms it |
| `flights` | the loop around an integrator with events: impacts, chatter, rest, release, compliant contacts |
| `ways` | what a way of simulating is to the measurement |
| `fused`, `solve_ivp`, `cvode`, `jax_flights`, `fmpy_import`, `time_stepping` | the ways, one module for each package |
| `measure` | error and processor time of each way at each setting |
| `page` | the goals, met or missed, and the table of docs/accuracy.md |
| `figure` | error against cost, a panel for each problem |

`make peers` runs it all and writes `docs/accuracy/peers.json`, `docs/accuracy/peers.png` and the tables of the page.
"""
