/* A mode with its harmonic force, its motion from one state, and parts of this motion. */
#ifndef VIBROIMPACT_SEGMENT_H
#define VIBROIMPACT_SEGMENT_H

#include <stdbool.h>
#include <stdint.h>

#include "sizes.h"

enum { VI_SERIES_ORDER = 20 };

typedef enum { VI_UNDERDAMPED, VI_CRITICAL, VI_OVERDAMPED } vi_damping_regime;

/* A further sine of the force on a mode: force cos(its own phase). */
typedef struct {
    double force, angular_frequency; /* m/s^2; rad/s, > 0 */
    double cosine, sine;             /* steady response = cosine cos(phase) + sine sin(phase), m */
} vi_further;

/* A mode and the harmonic forces on it: that of the clock, and further sines. */
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
    double steady_amplitude;  /* m; the sum over all sines */
    double steady_snap;       /* the largest fourth derivative of the steady response, m/s^4 */
    double force_size;        /* sum of the sizes of the forces of all sines, m/s^2 */
    double fastest;           /* largest of all rates and all angular frequencies of forces, rad/s */
    int32_t sines;            /* number of further sines */
    vi_further further[VI_SINES_ROOM];
} vi_mode;

/* May a motion of this mode grow by itself? */
static inline bool vi_mode_grows(const vi_mode *mode)
{
    return VI_GROWING && mode->growth > 0.0;
}

/* Number of further sines; a constant where a component has none. */
static inline int vi_mode_sines(const vi_mode *mode)
{
    return VI_SINES > 0 ? mode->sines : 0;
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

/* Drive: all that acts on the modes from an instant on, per unit mass. */
typedef struct {
    vi_phase phase;                  /* of the clock's force */
    const vi_phase *further;         /* of the further sines */
    const double *held, *held_rate;  /* [modes]: held + held_rate u + sum of higher[n - 2] u^n, n = 2 to degree */
    int32_t degree;                  /* 1 to VI_DEGREE */
    const double (*higher)[VI_MODES]; /* [degree - 1][modes]; not read at degree 1 */
} vi_drive;

/* The flow from one state, with the held input. */
typedef struct {
    const vi_mode *mode;
    vi_phase phase;          /* of the clock's force at the start */
    const vi_phase *further; /* of the further sines at the start */
    double held, held_rate;
    int32_t degree;
    double higher[VI_HIGHER_ROOM]; /* of the load: coefficients 2 to degree */
    double length;        /* the segment is valid for 0 <= u <= length, s */
    double origin;        /* displacements are counted from here, m: 0 when split, else the start's */
    bool series;
    double coefficient[VI_SERIES_ORDER + 1]; /* Taylor, when series */
    double series_snap_bound;
    double x, v;          /* homogeneous state, when split, at `since` seconds before the start */
    double since, since_low; /* s, and its rounding */
    double start, start_rate; /* homogeneous displacement and velocity at the start, when split */
    double level, level_rate; /* particular solution of the load */
    double level_higher[VI_HIGHER_ROOM]; /* its coefficients 2 to degree */
    double swell;         /* bounds of a growing motion hold up to twice the length by this factor; else 1 */
    double amplitude;     /* |homogeneous| <= amplitude e^{-decay u} when underdamped */
    double slow_part, fast_part; /* amplitudes of the two exponentials when overdamped */
    double scale;         /* sum of the sizes of a displacement's terms, m; rounding is 1e-16 of it */
} vi_segment;

/* Degree of a segment's load; a constant where a component has none above 1. */
static inline int vi_segment_degree(const vi_segment *segment)
{
    return VI_DEGREE > 1 ? segment->degree : 1;
}

/* Add the terms 2 to `degree` of a polynomial in u to its value and to its first three derivatives. */
static inline void vi_add_higher(const double coefficient[], int degree, double u, double value[4])
{
    double x = 0.0, v = 0.0, a = 0.0, j = 0.0; /* value, and derivatives over 1, 2 and 6 */
    for (int n = degree; n >= 0; --n) {
        j = j * u + a;
        a = a * u + v;
        v = v * u + x;
        x = x * u + (n >= 2 ? coefficient[n - 2] : 0.0);
    }
    value[0] += x;
    value[1] += v;
    value[2] += 2.0 * a;
    value[3] += 6.0 * j;
}

#endif
