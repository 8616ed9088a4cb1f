/* Modes of a chain: ground - k_1, c_1 - m_1 - k_2, c_2 - m_2 - ... - m_N [- k_{N+1}, c_{N+1} - ground]. equations.md 5 */
#ifndef VIBROIMPACT_CHAIN_MODES_H
#define VIBROIMPACT_CHAIN_MODES_H

#include <stdbool.h>

#include "sizes.h"

typedef struct {
    int masses;
    double mass[VI_MODES];            /* kg, > 0 */
    double stiffness[VI_MODES + 1];   /* N/m, >= 0; the last is the spring to the ground at the far end, or 0 */
    double damping[VI_MODES + 1];     /* N s/m, >= 0; likewise */
} vi_chain;

typedef struct {
    double natural[VI_MODES];            /* angular frequencies, ascending, rad/s */
    double damping_ratio[VI_MODES];      /* of each mode; for a chain whose damping couples the modes, of the diagonal */
    double shape[VI_MODES][VI_MODES];    /* shape[i][j]: displacement of mass i for q_j = 1, kg^(-1/2) */
    bool classical;                      /* C M^-1 K = K M^-1 C to rounding: the damping does not couple the modes */
    double damping[VI_MODES][VI_MODES];  /* modal damping matrix, 1/s (all of it, also when classical) */
} vi_chain_modes;

/* Closed form for uniform chains (equal m, k; no far spring), else the symmetric eigensolver. Two or more massless-spring
 * cuts (k = 0) give modes of frequency 0. Returns false when the eigensolver does not converge. */
bool vi_chain_find_modes(const vi_chain *chain, vi_chain_modes *modes);

#endif
