/* Complex modes of a body that rests on several stops at once, or whose damping couples its modes, or is strong.
 *
 * The modes without damping come first: the held contacts are reflected away, and of what is left, a factor of the
 * stiffness with a row for each mode and each stop that is pressed, the singular values are found to high relative
 * accuracy (modes/singular.h), so that a stop of 1e12 N/m takes no digits off slow modes. In them, as (Omega x, -i x'), the
 * damped motion is z' = M z with M complex symmetric (modes/symmetric.h): nothing but near critical damping costs digits.
 * equations.md 3.4, 6.9 */
#ifndef VIBROIMPACT_COUPLED_MODES_H
#define VIBROIMPACT_COUPLED_MODES_H

#include "modes/pressed_terms.h"
#include "modes/singular.h"
#include "modes/symmetric.h"

/* Room to find them in, for the length of a call. */
typedef struct {
    int reflections;
    double reflection[VI_PORTS][VI_MODES]; /* unit vectors; of the held contacts */
    double triangle[VI_PORTS][VI_PORTS];   /* [i][k], k >= i: the held shapes, reflected */
    double factor[VI_ROWS][VI_MODES];
    vi_singular real;
    double shape[VI_MODES][VI_MODES];      /* of the modes without damping */
    double at[VI_PORTS][VI_MODES];         /* their displacements at the contacts that press */
    double damping[VI_MODES][VI_MODES];    /* between them, 1/s */
    vi_complex matrix[VI_STATES][VI_STATES], vector[VI_STATES][VI_STATES];
} vi_coupled_work;

/* False where they cannot be told to the last digits: nearly critical damping, held contacts next to dependent on each
 * other, a point that nothing holds back. */
bool vi_coupled_modes_find(vi_pressed_modes *found, const vi_pressed_body *body, vi_coupled_work *work);

#endif
