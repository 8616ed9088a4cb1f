/* A small change of a component at one instant, to first order: for its partial derivatives.
 *
 * The equations of an instant are linear in such a change, as equations.md 6.15 has them. Two lists of variables stand at
 * their ends: knowns, which a column of the linear map describes, and unknowns, which a row describes. Both are a vi_line.
 */
#ifndef VIBROIMPACT_VARIATION_H
#define VIBROIMPACT_VARIATION_H

#include "sizes.h"

/* The change. First `load` has modal forces, and `contact` the given forces of pressed contacts. A held contact has there
 * the acceleration at which its stop comes nearer, m/s^2. After the equations have carried the change, they have modal accelerations and the forces of the contacts. */
typedef struct {
    double displacement[VI_MODES], velocity[VI_MODES], load[VI_MODES]; /* of the modes */
    double base;              /* acceleration of the base, m/s^2 */
    double contact[VI_PORTS]; /* N */
} vi_variation;

/* A variable as a linear form of the change: its derivative over each part. All 0: the variable depends on none. */
typedef struct {
    const double *shape; /* numbers of the modes `first` to `first` + `count` - 1 */
    int first, count;
    /* `alike`: number of variables of its array, from this one on, that are alike; 0: it is alone. Variable m has its one
     * number at mode `first` + m. With `rows` it has row m of a matrix of VI_MODES columns, times weight[m]. From `used`
     * on all is 0. */
    int alike, used, rows;
    const double *weight; /* NULL: 1 for all, as it is without `rows` */
    double displacement, velocity, load; /* factors of the shape */
    double base;
    int port; /* the contact of `force`, from 0 */
    double force;
    double own[VI_MODES]; /* room for a shape that is nowhere else */
    double present[VI_PORTS]; /* forces of the contacts now */
    /* Have `own` and `present` been set by a line of this call? They stay from line to line, and serve later ones. */
    int own_known, forces_known;
} vi_line;

/* Number of modes in the shape; at most one where the compiler knows that there is one. */
static inline int vi_line_count(const vi_line *line)
{
    return VI_ONLY_MODES == 1 ? line->count > 0 : line->count;
}

/* Sum of a shape times a part of the change; a factor of 0 leaves out what may be infinite. */
static inline double vi_line_product(const vi_line *line, double factor, const double part[])
{
    double sum = 0.0;
    for (int i = 0; i < vi_line_count(line) && factor != 0.0; ++i) {
        sum += line->shape[i] * part[line->first + i];
    }
    return factor * sum;
}

/* The change of the variable. */
static inline double vi_line_read(const vi_line *line, const vi_variation *change)
{
    return vi_line_product(line, line->displacement, change->displacement)
           + vi_line_product(line, line->velocity, change->velocity) + vi_line_product(line, line->load, change->load)
           + line->base * change->base + line->force * change->contact[line->port];
}

#endif
