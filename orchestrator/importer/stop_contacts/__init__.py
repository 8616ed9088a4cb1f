"""Contacts of bodies with stops that are other components: body and stop agree on the force over each step.

`contact_bond` is for a body that follows the force of its stop, `held_force` for a body of another tool, which holds a
force. `asked_stop` evaluates the stop's force, and `step_path` is the path of the contact point over a step.
`force_input` is the effect of a force on a body, `pulse` the impulse of a body that takes only forces.
`plain_contacts` measures the error of a plain connection.
"""
