/* A mode with its harmonic force, its motion from one state, and parts of this motion. */
#ifndef VIBROIMPACT_SEGMENT_H
#define VIBROIMPACT_SEGMENT_H

#include <stdbool.h>

#include "sizes.h"

enum { VI_SERIES_ORDER = 20 };

typedef enum { VI_UNDERDAMPED, VI_CRITICAL, VI_OVERDAMPED } vi_damping_regime;

/* A mode and the harmonic force on it. */
typedef struct {
    double stiffness;         /* 1/s^2 */
    double natural;           /* sqrt|stiffness|, rad/s */
    double decay;             /* half the damping, 1/s */
    vi_damping_regime regime;
    double rate;              /* sqrt|stiffness - decay^2|, rad/s (1/s overdamped) */
    double slow, fast;        /* decay rates when overdamped, 1/s; slow < 0: this part grows */
    double growth;            /* rate above which nothing grows, 1/s: equations.md 1.9; 0 where the energy never grows */
    double force;             /* amplitude per unit mass, m/s^2 */
    double angular_frequency; /* of the force, rad/s */
    bool steady_exists;
    double steady_cos, steady_sin; /* steady response = steady_cos cos(phase) + steady_sin sin(phase), m */
    double steady_amplitude;  /* m */
    double steady_snap;       /* its largest fourth derivative, m/s^4 */
    double fastest;           /* largest of all rates and angular_frequency, rad/s */
} vi_mode;

/* May a motion of this mode grow by itself? */
static inline bool vi_mode_grows(const vi_mode *mode)
{
    return VI_GROWING && mode->growth > 0.0;
}

/* Displacement, velocity, acceleration and jerk at one instant, with a bound that holds from here on. */
typedef struct {
    double x; /* from the segment's origin */
    double v, a, j;
    double snap_bound; /* >= |x''''| from here to the end of the segment */
} vi_motion;

/* The unforced part of a motion at one instant, with bounds that hold from here on. */
typedef struct {
    double x, v, a, j;
    double snap_bound; /* >= |fourth derivative| from here to the end of the segment */
    double reach;      /* >= |x| likewise */
} vi_part;

/* A forcing phase, rad, with its cosine and sine. */
typedef struct {
    double angle, cosine, sine;
} vi_phase;

/* The flow from one state, with the held input. */
typedef struct {
    const vi_mode *mode;
    vi_phase phase;       /* of the force at the start */
    double held, held_rate;
    double length;        /* the segment is valid for 0 <= u <= length, s */
    double origin;        /* displacements are counted from here, m: 0 when split, else the start's */
    bool series;
    double coefficient[VI_SERIES_ORDER + 1]; /* Taylor, when series */
    double series_snap_bound;
    double x, v;          /* homogeneous state, when split, at `since` seconds before the start */
    double since, since_low; /* s, and its rounding */
    double start, start_rate; /* homogeneous displacement and velocity at the start, when split */
    double level, level_rate; /* particular solution of the held input */
    double swell;         /* bounds of a growing motion hold up to twice the length by this factor; else 1 */
    double amplitude;     /* |homogeneous| <= amplitude e^{-decay u} when underdamped */
    double slow_part, fast_part; /* amplitudes of the two exponentials when overdamped */
    double scale;         /* sum of the sizes of a displacement's terms, m; rounding is 1e-16 of it */
} vi_segment;

#endif
