"""The importer (FMI's word for a co-simulation master) that couples FMUs and locates their events.

Any set of co-simulation FMUs, FMI 2.0 and 3.0 mixed. An event ends the step of all of them at one instant:

- FMI 3.0 with event mode: the FMU returns early at its event;
- FMI 2.0 of ours: the FMU reports the time in `event_time`; the step is repeated to it from a saved state;
- any FMU with states: a watched variable's crossing is found by step revision (`revision`);
- several events in one step: the earliest wins, the others are rolled back;
- in a contact with a stop that yields the steps are short, and body and stop agree over each (`stop_contacts`; a body
  of another tool gets a force that is held over the step, or a very short one as an impulse);
- bodies that meet in a step are stepped to where they do, and give each other impulses or forces there (`pairs`);
- an input clock ticks at an instant that is known: the step ends there (`ticks`);
- FMUs without states are stepped last, once the end of the step is agreed.

`specification` says what an importer is made of, `component` is one FMU in it, `wiring` moves values between them and
solves algebraic loops, `order` says who is stepped first, `step_plan` what a step must do, `master` steps them,
`plain_loop` makes plain steps in C, `events` resolves events, `ticks` has the clocks,
`contacts` are all places where bodies touch something,
`sampling` and `energy` watch without disturbing.
"""
