"""The study of `vibroimpact accuracy` for other people's solvers, on six problems with confirmed references.

| module | idea |
|---|---|
| `problems` | the six problems, as scenes of this package and as linear pieces for the peers to integrate |
| `references` | the references of all errors, and the independent computation that confirms them |
| `flights` | the loop around an integrator with events: impacts, chatter, rest, release, compliant contacts |
| `ways` | a way of simulating: a method with its settings, as the measurement sees it |
| `fused`, `solve_ivp`, `cvode`, `jax_flights`, `fmpy_import`, `time_stepping` | the ways, one module for each package |
| `measure` | error and processor time of each way at each setting |
| `page` | the goals, met or missed, and the table of docs/accuracy.md |
| `figure` | error against cost, a panel for each problem |

`make peers` runs it all and writes `docs/accuracy/peers.json`, `docs/accuracy/peers.png` and the tables of the page.
"""
