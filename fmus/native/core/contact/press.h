/* How a stop that yields presses: the form of its force, from which the series of the motion, the sign of the force and the
 * rounding of that sign follow. A law that has one of these forms needs no more than its numbers. equations.md 6.9, 6.10 */
#ifndef VIBROIMPACT_PRESS_H
#define VIBROIMPACT_PRESS_H

#include <stdint.h>

typedef enum {
    VI_PRESS_NONE = 0,
    VI_PRESS_HOLD = 1,   /* the force that keeps the contact at rest */
    VI_PRESS_LINEAR = 2, /* constant + stiffness d + damping d' */
    VI_PRESS_POWER = 3   /* stiffness d^exponent (1 + damping d'), d > 0 */
} vi_press_kind;

/* How a contact presses; d = sign (displacement - position) is its penetration. */
typedef struct {
    int64_t kind; /* vi_press_kind; 64 bits: no padding */
    double constant, stiffness, damping, exponent;
} vi_press;

/* What has the sign of the force, where a constant is none: the force itself or, of a power law, 1 + damping d'. */
static inline double vi_press_sense(const vi_press *press, double depth, double rate)
{
    return press->damping * rate + (press->kind == VI_PRESS_POWER ? 1.0 : press->stiffness * depth);
}

/* The same sign as a distance, m: the depth that the force is as large at in rest; of a power law what is left of
 * 1 + damping d', times a typical depth. */
static inline double vi_press_sense_depth(const vi_press *press, double depth, double rate, double typical)
{
    return press->kind == VI_PRESS_POWER ? typical * (1.0 + press->damping * rate)
                                         : depth + press->damping / press->stiffness * rate;
}

#endif
