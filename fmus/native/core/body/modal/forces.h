/* The forces on a structure now: of its modes, its inputs and the contacts that press. */
#ifndef VIBROIMPACT_MODAL_FORCES_H
#define VIBROIMPACT_MODAL_FORCES_H

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* How the stop of contact k presses a body that yields to it, whether it does so now or not. */
vi_press vi_structure_stop_press(const vi_structure *s, int k);

/* How contact k presses now. */
vi_press vi_structure_press(const vi_structure *s, int k);

/* Modal accelerations now, and the forces of held and yielding contacts; held ones may come out negative: they would
 * have to pull. */
void vi_structure_accelerate(const vi_structure *s, double acceleration[], double force[]);

/* The same without the forces of held contacts. */
void vi_structure_accelerate_freely(const vi_structure *s, double acceleration[], double force[]);

/* Force of a yielding contact now, and its slopes. */
vi_contact_force vi_structure_yield(const vi_structure *s, int k);

/* Add to a modal vector what a force (or impulse, over mass-normalised modes) of contact k on the body adds. */
void vi_structure_push(const vi_structure *s, int k, double force, double modal[]);

/* A matrix between contacts, seen from their stops: towards them counts positive. */
void vi_structure_signed(const vi_structure *s, double matrix[VI_PORTS][VI_PORTS], double g[VI_PORTS][VI_PORTS]);

/* Put the held contacts back on their stops, at rest: takes off what rounding has added. */
void vi_structure_project(const vi_structure *s);

#endif
