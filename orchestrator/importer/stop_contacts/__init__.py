"""Contacts of bodies with stops that are other components: forces that both agree on over each step.

`contact_bond` where the body follows the force of its stop, `held_force` where it is another tool's and holds one:
`asked_stop` says what the stop answers, `step_path` where the contact point goes over a step, `force_input` what a
force does to the body, `pulse` is the impulse of a body that takes forces only. `plain_contacts` is what a plain
connection does instead.
"""
