"""The importer couples FMUs and locates their events (FMI's word for a co-simulation master).

It takes FMUs for co-simulation or model exchange, FMI 2.0 and 3.0 mixed. An event ends the step of all components at
one instant:

- FMI 3.0 with event mode: the FMU returns early at its event;
- FMI 2.0 of this package: the FMU reports the time in `event_time`; the step is repeated to it from a saved state;
- any FMU with states: step revision finds the crossing of a watched variable (`revision`);
- several events in one step: the earliest wins, the others are rolled back;
- in a contact with a yielding stop the steps are short, and body and stop agree over each (`stop_contacts`). The body
  of another tool gets a force held over the step, or a very short force as an impulse;
- bodies that meet in a step are stepped to that instant, and give each other impulses or forces there (`pairs`);
- an input clock ticks at a known instant: the step ends there (`ticks`);
- FMUs without states are stepped last, once the end of the step is agreed.

`specification` has the parts of an importer, and `component` is one FMU in it. `wiring` moves values between
components, in the order of `feedthrough`, and `loops` solves algebraic loops. `order` sorts the components,
`step_plan` lists the work of a step, `master` makes the steps, `plain_loop` makes plain steps in C. `events` resolves
events, `ticks` has the clocks. `contacts` are all places where bodies touch something. `sampling` and `energy` watch
without disturbing.
"""
