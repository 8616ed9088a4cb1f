/* The form of the force of a stop that yields. The series of the motion, the sign of the force and the rounding of this
 * sign follow from the form. A new law of one of these forms needs only its numbers. equations.md 6.9, 6.10 */
#ifndef VIBROIMPACT_PRESS_H
#define VIBROIMPACT_PRESS_H

#include <stdint.h>

typedef enum {
    VI_PRESS_NONE = 0,
    VI_PRESS_HOLD = 1,   /* the force that keeps the contact at rest */
    VI_PRESS_LINEAR = 2, /* constant + stiffness d + damping d' */
    VI_PRESS_POWER = 3   /* stiffness d^exponent (1 + damping d'), d > 0 */
} vi_press_kind;

/* The form and the numbers of a contact's force; d = sign (displacement - position) is the penetration. */
typedef struct {
    int64_t kind; /* vi_press_kind; 64 bits, to avoid padding */
    double constant, stiffness, damping, exponent;
} vi_press;

/* A number with the sign of the force when `constant` is 0: the force, or 1 + damping d' for a power law. */
static inline double vi_press_sense(const vi_press *press, double depth, double rate)
{
    return press->damping * rate + (press->kind == VI_PRESS_POWER ? 1.0 : press->stiffness * depth);
}

/* A distance with the same sign, m. For a linear law it is the depth at which the force at rest is as large. For a
 * power law it is 1 + damping d' times a typical depth. */
static inline double vi_press_sense_depth(const vi_press *press, double depth, double rate, double typical)
{
    return press->kind == VI_PRESS_POWER ? typical * (1.0 + press->damping * rate)
                                         : depth + press->damping / press->stiffness * rate;
}

#endif
