/* The equations of an instant, linear in a small change of a body: equations.md 6.15. */
#ifndef VIBROIMPACT_CARRY_H
#define VIBROIMPACT_CARRY_H

#include "body/modal/state.h"
#include "body/modal/stop_motion.h"
#include "body/modal/variation.h"

/* Carry a change: its loads become modal accelerations, its applied forces the forces of the contacts. */
void vi_structure_carry(const vi_structure *s, vi_variation *change);

/* Carry it by the transposed equations, from accelerations and forces back to the motion and the loads. */
void vi_structure_carry_back(const vi_structure *s, vi_variation *change);

/* The part `contact` of a change whose stop of contact k moves along a course: a force, or an approach where it holds. */
double vi_structure_push_of_stop(const vi_structure *s, int k, const vi_stop_course *course);

#endif
