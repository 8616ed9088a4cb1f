/* Householder's reflections. */
#ifndef VIBROIMPACT_REFLECTION_H
#define VIBROIMPACT_REFLECTION_H

static inline double vi_dot(int n, const double x[], const double y[])
{
    double sum = 0.0;
    for (int j = 0; j < n; ++j) {
        sum += x[j] * y[j];
    }
    return sum;
}

/* x - 2 unit (unit.x) */
static inline void vi_reflect(int n, const double unit[], double x[])
{
    const double twice = 2.0 * vi_dot(n, unit, x);
    for (int j = 0; j < n; ++j) {
        x[j] -= twice * unit[j];
    }
}

#endif
