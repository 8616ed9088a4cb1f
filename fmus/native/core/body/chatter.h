/* Chatter, for all bodies: which bounces are low, and what becomes of those still to come. equations.md 3.1 */
#ifndef VIBROIMPACT_CHATTER_H
#define VIBROIMPACT_CHATTER_H

#include <stdbool.h>
#include <stdint.h>

/* Height of a bounce, relative to the displacements, below which it is tiny; its length, in radians of the fastest rate,
 * below which it is. */
#define VI_LOW_HEIGHT 1e-10
#define VI_SHORT_FLIGHT 1e-7

/* The bounces after an impact: the body leaves its stop at speed `rebound`, and is pressed back. */
typedef struct {
    double rebound, restitution;   /* m/s */
    double pressure, slope, bend;  /* acceleration towards the stop if held there, m/s^2, and its rates */
    double drag;       /* rate at which damping takes the speed, 1/s */
    double fastest;    /* rate of the motion, rad/s */
    double moving;     /* rate of what moves on while the contact is held, rad/s; 0: nothing does */
    double resolution; /* of displacements, m */
    bool tiny;         /* not higher, or not longer, than VI_LOW_HEIGHT and VI_SHORT_FLIGHT say */
} vi_bounces;

/* What becomes of them. */
typedef struct {
    bool rests;       /* the body rests now: the bounces are summed, or cannot be followed */
    bool summed;
    double duration;  /* of the bounces that were summed, s */
} vi_chatter;

/* Is a bounce at this speed so short that it is followed from its stop? */
bool vi_chatter_is_low(double pressure, double speed, double fastest);

/* Can a touch at this speed not be told from a miss? It stands for less penetration than can be resolved. */
bool vi_chatter_is_graze(double approach, double acceleration, double resolution);

/* Count an impact in its sequence: the largest approach so far and the low impacts in a row. True when the bounces
 * still to come are to be looked at. */
bool vi_chatter_count(double *fastest_impact, int64_t *low_impacts, double approach, double rebound, bool graze,
                      bool tiny);

/* What becomes of bounces that are pressed (pressure > 0) after so many low impacts in a row. */
vi_chatter vi_chatter_look(const vi_bounces *b, int64_t low_impacts);

#endif
