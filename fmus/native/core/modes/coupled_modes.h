/* Complex modes of a body that rests on several stops at once, or whose damping couples its modes, or is strong.
 *
 * The undamped modes come first. The held contacts are reflected away. A factor of the remaining stiffness has a row
 * for each mode and each pressed stop. Its singular values are found to high relative accuracy (modes/singular.h), so
 * that a stop of 1e12 N/m costs slow modes no digits. In these modes, as (Omega x, -i x'), the damped motion is z' = M
 * z with M complex symmetric (modes/symmetric.h). Only nearly critical damping costs digits. equations.md 3.4, 6.9
 */
#ifndef VIBROIMPACT_COUPLED_MODES_H
#define VIBROIMPACT_COUPLED_MODES_H

#include "modes/pressed_terms.h"
#include "modes/singular.h"
#include "modes/symmetric.h"

/* Workspace for the length of a call. */
typedef struct {
    int reflections;
    double reflection[VI_PORTS][VI_MODES]; /* unit vectors; of the held contacts */
    double triangle[VI_PORTS][VI_PORTS];   /* [i][k], k >= i: the reflected shapes of the held contacts */
    double factor[VI_ROWS][VI_MODES];
    vi_singular real;
    double shape[VI_MODES][VI_MODES];      /* of the undamped modes */
    double at[VI_PORTS][VI_MODES];         /* displacements of the undamped modes at the pressing contacts */
    double damping[VI_MODES][VI_MODES];    /* between the undamped modes, 1/s */
    vi_complex matrix[VI_STATES][VI_STATES], vector[VI_STATES][VI_STATES];
} vi_coupled_work;

/* Find the modes. False where they lose digits: nearly critical damping, held contacts that nearly depend on each
 * other, or a point that nothing holds back. */
bool vi_coupled_modes_find(vi_pressed_modes *found, const vi_pressed_body *body, vi_coupled_work *work);

/* Largest |z|^2 of the terms' states z = (w x, rate x), which have z.z = 1 without conjugation; 1 without damping. Terms
 * of larger ones cancel each other's digits. */
double vi_coupled_modes_size(const vi_pressed_modes *modes, const vi_pressed_body *body);

#endif
