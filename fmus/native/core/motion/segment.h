/* A mode with its harmonic force, its motion from one state, and parts of this motion. */
#ifndef VIBROIMPACT_SEGMENT_H
#define VIBROIMPACT_SEGMENT_H

#include <stdbool.h>

enum { VI_SERIES_ORDER = 20 };

typedef enum { VI_UNDERDAMPED, VI_CRITICAL, VI_OVERDAMPED } vi_damping_regime;

/* A mode and the harmonic force on it. */
typedef struct {
    double stiffness;         /* natural angular frequency squared, 1/s^2, >= 0 */
    double natural;           /* natural angular frequency, rad/s */
    double decay;             /* damping_ratio * natural, 1/s, >= 0 */
    vi_damping_regime regime;
    double rate;              /* sqrt|natural^2 - decay^2|, rad/s (1/s overdamped) */
    double slow, fast;        /* decay rates when overdamped, 1/s */
    double force;             /* amplitude per unit mass, m/s^2 */
    double angular_frequency; /* of the force, rad/s */
    bool steady_exists;
    double steady_cos, steady_sin; /* steady response = steady_cos cos(phase) + steady_sin sin(phase), m */
    double steady_amplitude;  /* m */
    double steady_snap;       /* its largest fourth derivative, m/s^4 */
    double fastest;           /* largest of natural, 2 decay, angular_frequency, rad/s */
} vi_mode;

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
    double amplitude;     /* |homogeneous| <= amplitude e^{-decay u} when underdamped */
    double slow_part, fast_part; /* amplitudes of the two exponentials when overdamped */
    double scale;         /* sum of the sizes of a displacement's terms, m; rounding is 1e-16 of it */
} vi_segment;

#endif
