/* The equations of an instant, linear in a small change of a body: equations.md 6.15. */
#ifndef VIBROIMPACT_CARRY_H
#define VIBROIMPACT_CARRY_H

#include "body/modal/state.h"
#include "body/modal/variation.h"

/* Carry a change: its loads become modal accelerations, its applied forces the forces of the contacts. */
void vi_structure_carry(const vi_structure *s, vi_variation *change);

/* Carry it by the transposed equations, from accelerations and forces back to the motion and the loads. */
void vi_structure_carry_back(const vi_structure *s, vi_variation *change);

#endif
