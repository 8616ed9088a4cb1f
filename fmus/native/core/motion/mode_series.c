#include "motion/mode_series.h"

#include <math.h>

#include "motion/rows.h"

/* Length of a series segment, in units of 1 / fastest rate; the 21st term is then below 1e-17 of the first. */
static const double SERIES_REACH = 0.7;

/* 1 / ((n + 1) (n + 2)): factor of the differential equation's recurrence for Taylor coefficient n + 2. */
static const double SHARE[VI_SERIES_ORDER - 1] = {1.0 / 2.0,   1.0 / 6.0,   1.0 / 12.0,  1.0 / 20.0,  1.0 / 30.0,
                                                  1.0 / 42.0,  1.0 / 56.0,  1.0 / 72.0,  1.0 / 90.0,  1.0 / 110.0,
                                                  1.0 / 132.0, 1.0 / 156.0, 1.0 / 182.0, 1.0 / 210.0, 1.0 / 240.0,
                                                  1.0 / 272.0, 1.0 / 306.0, 1.0 / 342.0, 1.0 / 380.0};
/* n (n - 1) (n - 2) (n - 3): factor of Taylor coefficient n in the fourth derivative. */
static const double FOURTH[VI_SERIES_ORDER + 1] = {0.0,     0.0,     0.0,     0.0,     24.0,    120.0,   360.0,
                                                   840.0,   1680.0,  3024.0,  5040.0,  7920.0,  11880.0, 17160.0,
                                                   24024.0, 32760.0, 43680.0, 57120.0, 73440.0, 93024.0, 116280.0};

/* Functions must be inlined for the compiler to know the numbers of modes that they are given as constants. */
#define INLINE static inline __attribute__((always_inline))

/* Modes whose coefficients are found side by side, since each coefficient of a mode waits for the one before. */
enum { ABREAST = 8 };

/* Taylor coefficients, indexed by order n, then by mode. */
typedef double coefficients[VI_SERIES_ORDER + 1][ABREAST];

/* Taylor coefficients of the loads without the clock's force: further sines, and polynomials of degree 2 and above.
 * False where there are none; then the coefficients are not set. */
INLINE bool add_more(double more[VI_SERIES_ORDER - 1][ABREAST], const vi_segment s[], const double x[], const int count)
{
    const int sines = vi_mode_sines(s[0].mode), degree = vi_segment_degree(&s[0]);
    if (sines == 0 && degree < 2) {
        return false;
    }
    for (int n = 0; n <= VI_SERIES_ORDER - 2; ++n) {
        for (int i = 0; i < count; ++i) {
            more[n][i] = n == 0 ? s[i].held - s[i].mode->stiffness * x[i] : n == 1 ? s[i].held_rate : 0.0;
            more[n][i] += n >= 2 && n <= degree ? s[i].higher[n - 2] : 0.0;
        }
    }
    for (int k = 0; k < sines; ++k) {
        for (int i = 0; i < count; ++i) {
            const vi_further *sine = &s[i].mode->further[k];
            const double w = sine->angular_frequency;
            double load[2] = {sine->force * s[i].further[k].cosine, -sine->force * w * s[i].further[k].sine};
            for (int n = 0; n <= VI_SERIES_ORDER - 2; ++n) {
                more[n][i] += load[n % 2];
                load[n % 2] = -load[n % 2] * w * w * SHARE[n];
            }
        }
    }
    return true;
}

/* Taylor coefficients of `count` modes from the differential equation itself. Each caller passes a constant count:
 * loops over one mode vanish, loops over ABREAST become vectors. */
INLINE void find_coefficients(coefficients c, const vi_segment s[], const double x[], const double v[],
                                     const int count)
{
    double drive[2][ABREAST], held[3][ABREAST] = {{0.0}}, rate[ABREAST], damping[ABREAST], stiffness[ABREAST];
    for (int i = 0; i < count; ++i) {
        const vi_mode *mode = s[i].mode;
        rate[i] = mode->angular_frequency;
        damping[i] = 2.0 * mode->decay;
        stiffness[i] = mode->stiffness;
        drive[0][i] = mode->force * s[i].phase.cosine;
        drive[1][i] = -mode->force * rate[i] * s[i].phase.sine;
        held[0][i] = s[i].held - stiffness[i] * x[i];
        held[1][i] = s[i].held_rate;
        c[0][i] = 0.0;
        c[1][i] = v[i];
    }
    double more[VI_SERIES_ORDER - 1][ABREAST];
    const bool any_more = add_more(more, s, x, count);
    for (int n = 0; n + 2 <= VI_SERIES_ORDER; ++n) {
        const double next = (double)n + 1.0, share = SHARE[n], *restrict constant = any_more ? more[n] : held[n < 2 ? n : 2];
        const double *restrict now = c[n], *restrict later = c[n + 1];
        double *restrict load = drive[n % 2], *restrict last = c[n + 2];
        for (int i = 0; i < count; ++i) {
            const double sum = load[i] + constant[i] - damping[i] * next * later[i] - stiffness[i] * now[i];
            last[i] = sum * share;
            load[i] = -load[i] * rate[i] * rate[i] * share;
        }
    }
}

/* Begin the series of `count` prepared segments, with bounds up to the ends of the segments. */
INLINE void begin_series(vi_segment s[], const double x[], const double v[], const int count)
{
    coefficients c;
    double snap[ABREAST] = {0.0}, scale[ABREAST] = {0.0}, length[ABREAST];
    find_coefficients(c, s, x, v, count);
    for (int i = 0; i < count; ++i) {
        const double fastest = s[i].mode->fastest;
        length[i] = fastest > 0.0 ? fmin(s[i].length, SERIES_REACH / fastest) : s[i].length;
    }
    for (int n = VI_SERIES_ORDER; n >= 4; --n) {
        for (int i = 0; i < count; ++i) {
            snap[i] = snap[i] * length[i] + FOURTH[n] * fabs(c[n][i]);
            scale[i] = scale[i] * length[i] + fabs(c[n][i]);
        }
    }
    for (int n = 3; n >= 0; --n) {
        for (int i = 0; i < count; ++i) {
            scale[i] = scale[i] * length[i] + fabs(c[n][i]);
        }
    }
    for (int i = 0; i < count; ++i) {
        s[i].origin = x[i];
        s[i].length = length[i];
        s[i].series_snap_bound = snap[i];
        s[i].scale = scale[i];
        for (int n = 0; n <= VI_SERIES_ORDER; ++n) {
            s[i].coefficient[n] = c[n][i];
        }
    }
}

void vi_series_begin(vi_segment *segment, double x, double v)
{
    begin_series(segment, &x, &v, 1);
}

void vi_series_begin_all(vi_segment segments[], int count, const double x[], const double v[])
{
    int j = 0;
    for (; j + ABREAST <= count; j += ABREAST) {
        begin_series(&segments[j], &x[j], &v[j], ABREAST);
    }
    for (; j < count; ++j) {
        begin_series(&segments[j], &x[j], &v[j], 1);
    }
}

void vi_series_at(const vi_segment *s, double u, vi_motion *m)
{
    const vi_mode *mode = s->mode;
    const double *c = s->coefficient;
    double x = c[VI_SERIES_ORDER], v = (double)VI_SERIES_ORDER * c[VI_SERIES_ORDER];
    for (int n = VI_SERIES_ORDER - 1; n >= 1; --n) {
        x = x * u + c[n];
        v = v * u + (double)n * c[n];
    }
    m->x = x * u;
    m->v = v;
    const double angle = s->phase.angle + mode->angular_frequency * u;
    m->a = mode->force * cos(angle) + (s->held + s->held_rate * u) - 2.0 * mode->decay * m->v
           - mode->stiffness * (s->origin + m->x);
    m->j = s->held_rate - mode->force * mode->angular_frequency * sin(angle) - 2.0 * mode->decay * m->a
           - mode->stiffness * m->v;
    m->snap_bound = s->series_snap_bound;
}

void vi_series_part(const vi_segment *s, double u, vi_part *part)
{
    const double *c = s->coefficient;
    double x = c[VI_SERIES_ORDER], v = 0.0, a = 0.0, j = 0.0; /* value, and derivatives over 1, 2 and 6 */
    if (u == 0.0) {
        *part = (vi_part){c[0], c[1], 2.0 * c[2], 6.0 * c[3], s->series_snap_bound, s->scale};
        return;
    }
    for (int n = VI_SERIES_ORDER - 1; n >= 0; --n) {
        j = j * u + a;
        a = a * u + v;
        v = v * u + x;
        x = x * u + c[n];
    }
    *part = (vi_part){x, v, 2.0 * a, 6.0 * j, s->series_snap_bound, s->scale};
}

/* Series that are summed side by side, since the terms of one sum wait for each other. */
enum { SUMS = 2 * VI_LANES };

/* The parts of SUMS series after u > 0 seconds, with the bits of vi_series_part. */
static void sum_series(const vi_segment s[], double u, vi_part part[])
{
    double x[2][VI_LANES], v[2][VI_LANES] = {{0.0}}, a[2][VI_LANES] = {{0.0}}, j[2][VI_LANES] = {{0.0}};
    for (int i = 0; i < VI_LANES; ++i) {
        x[0][i] = s[i].coefficient[VI_SERIES_ORDER];
        x[1][i] = s[VI_LANES + i].coefficient[VI_SERIES_ORDER];
    }
    for (int n = VI_SERIES_ORDER - 1; n >= 0; --n) {
        for (int i = 0; i < VI_LANES; ++i) {
            j[0][i] = j[0][i] * u + a[0][i];
            a[0][i] = a[0][i] * u + v[0][i];
            v[0][i] = v[0][i] * u + x[0][i];
            x[0][i] = x[0][i] * u + s[i].coefficient[n];
        }
        for (int i = 0; i < VI_LANES; ++i) {
            j[1][i] = j[1][i] * u + a[1][i];
            a[1][i] = a[1][i] * u + v[1][i];
            v[1][i] = v[1][i] * u + x[1][i];
            x[1][i] = x[1][i] * u + s[VI_LANES + i].coefficient[n];
        }
    }
    for (int k = 0; k < SUMS; ++k) {
        const int g = k / VI_LANES, i = k % VI_LANES;
        part[k] = (vi_part){x[g][i], v[g][i], 2.0 * a[g][i], 6.0 * j[g][i], s[k].series_snap_bound, s[k].scale};
    }
}

int vi_series_parts(const vi_segment segments[], int count, double u, vi_part parts[])
{
    for (int done = 0;; done += SUMS) {
        bool all = done + SUMS <= count;
        for (int i = done; all && i < done + SUMS; ++i) {
            all = segments[i].series;
        }
        if (!all) {
            return done;
        }
        sum_series(&segments[done], u, &parts[done]);
    }
}

void vi_series_end(const vi_segment *s, double u, double *displacement, double *velocity)
{
    const double *c = s->coefficient;
    double x = c[VI_SERIES_ORDER], v = 0.0;
    for (int n = VI_SERIES_ORDER - 1; n >= 0; --n) {
        v = v * u + x;
        x = x * u + c[n];
    }
    *displacement = s->origin + x;
    *velocity = v;
}
