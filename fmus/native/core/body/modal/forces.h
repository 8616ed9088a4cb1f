/* The present forces on a structure: of its modes, its inputs and the contacts that press. */
#ifndef VIBROIMPACT_MODAL_FORCES_H
#define VIBROIMPACT_MODAL_FORCES_H

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* Force law of the stop of contact k on a body that yields to it, whether or not it presses now. */
vi_press vi_structure_stop_press(const vi_structure *s, int k);

/* Present force law of contact k. */
vi_press vi_structure_press(const vi_structure *s, int k);

/* Present modal accelerations, and the forces of held and yielding contacts. Negative holding forces would pull. */
void vi_structure_accelerate(const vi_structure *s, double acceleration[], double force[]);

/* Modal accelerations without the forces of held contacts. */
void vi_structure_accelerate_freely(const vi_structure *s, double acceleration[], double force[]);

/* Present force of a yielding contact, and its slopes. */
vi_contact_force vi_structure_yield(const vi_structure *s, int k);

/* Add the effect of a force (or an impulse, as modes are mass-normalised) of contact k to a modal vector. */
void vi_structure_push(const vi_structure *s, int k, double force, double modal[]);

/* A matrix between contacts with the signs of their stops: towards the stops counts positive. */
void vi_structure_signed(const vi_structure *s, double matrix[VI_PORTS][VI_PORTS], double g[VI_PORTS][VI_PORTS]);

/* Set velocities of damped modes without a spring to 0 where a stop has left the rounding of `before` alone. Such a body
 * rests without load: its damping would turn the rounding into a force that lets it go. */
void vi_structure_clear_rounding(const vi_structure *s, const double before[], double p[]);

/* Put the held contacts back on their stops, at rest, which removes rounding. */
void vi_structure_project(const vi_structure *s);

#endif
