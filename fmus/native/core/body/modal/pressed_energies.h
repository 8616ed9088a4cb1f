/* Energies of a long rest: exact integrals of its terms, two by two. */
#ifndef VIBROIMPACT_PRESSED_ENERGIES_H
#define VIBROIMPACT_PRESSED_ENERGIES_H

#include "body/modal/pressed_flow.h"

/* Add what a rest of u seconds has done, from the displacements q to those of the body now. */
void vi_energies_of_rest(const vi_structure *s, const vi_pressed_flow *flow, const double q[], double u);

#endif
