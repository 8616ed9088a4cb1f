/* Certified steps of a sum of motions whose fast parts ripple: small displacements, large accelerations. */
#ifndef VIBROIMPACT_RIPPLE_H
#define VIBROIMPACT_RIPPLE_H

#include "motion/flow.h"
#include "motion/majorant.h"

/* sum += weight * part */
static inline void vi_part_add(vi_part *sum, double weight, const vi_part *part)
{
    sum->x += weight * part->x;
    sum->v += weight * part->v;
    sum->a += weight * part->a;
    sum->j += weight * part->j;
    sum->snap_bound += fabs(weight) * part->snap_bound;
}

/* Keep a sum, field by field: a copy of the whole struct would wait until its last field is stored. */
static inline void vi_part_keep(vi_part *kept, const vi_part *sum)
{
    kept->x = sum->x;
    kept->v = sum->v;
    kept->a = sum->a;
    kept->j = sum->j;
    kept->snap_bound = sum->snap_bound;
}

/* The approach of a motion to its stop, with clearance = offset - sign * displacement. */
static inline vi_approach vi_part_approach(const vi_part *sum, double offset, double sign)
{
    return (vi_approach){offset - sign * sum->x, sign * sum->v, sign * sum->a, sign * sum->j, sum->snap_bound};
}

/* A certified step, as vi_certified_step, of the motion sum[n]. sum[m] is this motion without its last n - m parts;
 * part m never moves it by more than ripple[m]. Where the clearance exceeds the ripple of the last parts, they are left
 * out and their ripple is subtracted from the clearance. The longest step over all numbers of left-out parts wins. */
double vi_rippling_step(const vi_part sum[], const double ripple[], int n, double offset, double sign, double horizon);

#endif
