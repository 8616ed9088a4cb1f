/* Chatter of all bodies: the low bounces, and the sum or the end of the remaining ones. equations.md 3.1 */
#ifndef VIBROIMPACT_CHATTER_H
#define VIBROIMPACT_CHATTER_H

#include <stdbool.h>
#include <stdint.h>

/* Height, relative to the displacements, and length, in radians of the fastest rate, below which a bounce is tiny. */
#define VI_LOW_HEIGHT 1e-10
#define VI_SHORT_FLIGHT 1e-7

/* Remaining bounces after an impact: the body leaves its stop at speed `rebound` and is pressed back. */
typedef struct {
    double rebound, restitution;   /* m/s */
    double pressure, slope, bend;  /* acceleration towards the stop while held there, m/s^2, and its two rates */
    double drag;       /* rate at which damping takes the speed, 1/s */
    double fastest;    /* rate of the motion, rad/s */
    double moving;     /* rate of other motion while the contact is held, rad/s; 0: nothing moves */
    double resolution; /* of displacements, m */
    bool tiny;         /* lower than VI_LOW_HEIGHT or shorter than VI_SHORT_FLIGHT */
} vi_bounces;

/* Result for the remaining bounces. */
typedef struct {
    bool sticks;      /* the body sticks now: the bounces are summed, or cannot be followed */
    bool summed;
    double duration;  /* of the summed bounces, s */
} vi_chatter;

/* Is a bounce at this speed so short that it is followed from its stop? */
bool vi_chatter_is_low(double pressure, double speed, double fastest);

/* Is a touch at this speed indistinguishable from a miss? Its penetration is then below the resolution. */
bool vi_chatter_is_graze(double approach, double acceleration, double resolution);

/* Count an impact in its sequence: update the fastest approach and the low impacts in a row. True when the remaining
 * bounces are to be examined with vi_chatter_look. */
bool vi_chatter_count(double *fastest_impact, int64_t *low_impacts, double approach, double rebound, bool graze,
                      bool tiny);

/* Decide about the remaining bounces of a pressed contact (pressure > 0) after this number of low impacts in a row. */
vi_chatter vi_chatter_look(const vi_bounces *b, int64_t low_impacts);

#endif
