/* A small change of a component at one instant, to first order: for its partial derivatives.
 *
 * The equations of an instant are linear in such a change, as equations.md 6.15 has them. Two lists of variables stand at
 * their ends: knowns, which a column of the linear map describes, and unknowns, which a row describes. Both are a vi_line.
 */
#ifndef VIBROIMPACT_VARIATION_H
#define VIBROIMPACT_VARIATION_H

#include "sizes.h"

/* The change. First `load` has modal forces, and `contact` the forces that another component applies. After the equations
 * have carried the change, they have modal accelerations and the forces of the contacts. */
typedef struct {
    double displacement[VI_MODES], velocity[VI_MODES], load[VI_MODES]; /* of the modes */
    double base;              /* acceleration of the base, m/s^2 */
    double contact[VI_PORTS]; /* N */
} vi_variation;

/* A variable as a linear form of the change: its derivative over each part. All 0: the variable depends on none. */
typedef struct {
    const double *shape; /* numbers of the modes `first` to `first` + `count` - 1 */
    int first, count;
    double displacement, velocity, load; /* factors of the shape */
    double base;
    int port; /* the contact of `force`, from 0 */
    double force;
    double own[VI_MODES]; /* room for a shape that is nowhere else */
} vi_line;

#endif
