/* Modes of a chain: ground - k_1, c_1 - m_1 - k_2, c_2 - m_2 - ... - m_N [- k_N+1, c_N+1 - ground]. equations.md 5 */
#ifndef VIBROIMPACT_CHAIN_MODES_H
#define VIBROIMPACT_CHAIN_MODES_H

#include <stdbool.h>

#include "sizes.h"

/* Element e (0-based) lies between mass e - 1 and mass e. Elements 0 and `masses` are tied to the ground. */
typedef struct {
    int masses;                       /* 1 to VI_MODES */
    double mass[VI_MODES];            /* kg, > 0 */
    double stiffness[VI_MODES + 1];   /* N/m, >= 0; [masses]: spring to the ground at the far end, or 0 */
    double damping[VI_MODES + 1];     /* N s/m, >= 0; [masses]: damper to the ground at the far end, or 0 */
} vi_chain;

/* Modes of a chain. As in the closed form of uniform chains, the first mass that takes part moves to the positive side.
 * A mass takes part if sqrt(mass) shape > 1e-8 of the mode's unit length. */
typedef struct {
    double natural[VI_MODES];            /* angular frequencies, ascending, rad/s */
    double damping_ratio[VI_MODES];      /* of each mode; where the damping couples the modes, from its diagonal */
    double shape[VI_MODES][VI_MODES];    /* shape[i][j]: displacement of mass i for q_j = 1, kg^(-1/2) */
    bool classical;                      /* C M^-1 K = K M^-1 C within rounding: damping does not couple modes */
    double damping[VI_MODES][VI_MODES];  /* modal damping matrix, 1/s (complete, also when classical) */
} vi_chain_modes;

/* Find the modes. Uniform chains (equal m, k; no far spring) have a closed form. Other chains use the singular values
 * of the factor B of M^-1/2 K M^-1/2 = B'B. This keeps small frequencies exact beside large ones: a few roundings
 * relative to each, for masses and stiffnesses over any number of decades.
 *
 * Masses that no spring ties to the ground move as one with the masses they are tied to: a mode of frequency 0. If such
 * a mode is damped, it has no damping ratio, and the chain counts as not classical. Returns false when a number is not
 * finite or out of its range.
 */
bool vi_chain_find_modes(const vi_chain *chain, vi_chain_modes *modes);

#endif
