/* The search of a step of CVODE for the first instant at which a contact point meets its surface. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_SEARCH_H
#define VIBROIMPACT_MODEL_EXCHANGE_SEARCH_H

#include <stdbool.h>

#include "door/model_exchange_calls.h"

/* The distance of a contact point from its level, m, and its rate, m/s, at an instant, s. */
typedef struct {
    double time, gap, rate;
} vi_exchange_gap;

/* The sign changes of the gap's Bernstein coefficients between two instants; `inside` is at VI_EXCHANGE_SPLIT of the part.
 * At 0 changes the gap stays positive; at 1 it falls through 0 once. `bend` becomes the largest coefficient, m, of the
 * deviation from a cubic. */
int vi_exchange_sign_changes(vi_exchange_gap first, vi_exchange_gap inside, vi_exchange_gap last, double *bend);
/* Search the step of CVODE from `before`, s, to the present point. Where a contact point meets its surface before the
 * present point, the step ends there, and `event` becomes false. `has_roots`: CVODE has located roots at its end. */
int vi_exchange_search_step(vi_exchange *exchange, double before, bool has_roots, bool *event);

/* Place within a part at which its motion is read: the golden section, so that no simple period repeats there. */
#define VI_EXCHANGE_SPLIT 0.38196601125010515

#endif
