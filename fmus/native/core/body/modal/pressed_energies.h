/* Energies of a long rest: exact integrals of pairs of its terms. */
#ifndef VIBROIMPACT_PRESSED_ENERGIES_H
#define VIBROIMPACT_PRESSED_ENERGIES_H

#include "body/modal/pressed_flow.h"

/* Add the energies of a rest of u seconds that moved the body from the displacements q to its present ones. */
void vi_energies_of_rest(const vi_structure *s, const vi_pressed_flow *flow, const double q[], double u);

#endif
