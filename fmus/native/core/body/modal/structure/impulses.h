/* Impulses of contacts that hit at once. equations.md 3.5, 5 */
#ifndef VIBROIMPACT_STRUCTURE_IMPULSES_H
#define VIBROIMPACT_STRUCTURE_IMPULSES_H

#include "body/modal/state.h"

/* Solve for the impulses that change the approaches of the contacts in play; all others are left out. impulse_low: the
 * rounding of the impulses, N s. */
void vi_structure_joint_impulses(const vi_structure *s, const int in_play[], const double change[], double impulse[],
                                 double impulse_low[]);

/* Add the impulses to the modes, rounded once: parts below its rounding still decide the rounding of a velocity. */
void vi_structure_give_impulses(const vi_structure *s, const double impulse[], const double low[]);

#endif
