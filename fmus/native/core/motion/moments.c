#include "motion/moments.h"

#include <math.h>
#include <string.h>

#include "motion/complex.h"

/* Damped rate, relative to the natural rate, below which the difference of the two exponentials loses digits. */
static const double LEAST_RATE = 0.01;
/* |z| below which the power series serves; above which the recurrence goes upwards, for light and for any damping. */
static const double SMALL = 0.25, LARGE = 16.0, LARGEST = 100.0;
/* Share of the decay in |z| up to which the damping is light. */
static const double LIGHT = 0.5;
/* Terms of the power series: the last is below 1e-17 of the first. */
enum { TERMS = 7 };

bool vi_moments_exist(const vi_mode *mode)
{
    return (mode->natural == 0.0 && mode->decay == 0.0)
           || (mode->regime == VI_UNDERDAMPED && mode->rate >= LEAST_RATE * mode->natural);
}

/* e^z i_n(z) for small z: z^n / (2n + 1)!! times a power series of z^2 / 2. */
static void by_powers(vi_complex z, vi_complex whole, vi_complex bessel[VI_NODES])
{
    const vi_complex half = vi_complex_scale(0.5, vi_complex_multiply(z, z));
    vi_complex first = whole;
    for (int n = 0; n < VI_NODES; ++n) {
        vi_complex sum = {1.0, 0.0};
        for (int k = TERMS; k >= 1; --k) {
            const double share = 1.0 / ((double)k * (double)(2 * n + 2 * k + 1));
            sum = vi_complex_scale(share, vi_complex_multiply(half, sum));
            sum.re += 1.0;
        }
        bessel[n] = vi_complex_multiply(first, sum);
        first = vi_complex_scale(1.0 / (double)(2 * n + 3), vi_complex_multiply(first, z));
    }
}

/* The first two, from exponentials: e^z i_0 = (e^2z - 1) / 2z, e^z i_1 = ((e^2z + 1) / 2 - e^z i_0) / z. */
static void first_two(vi_complex z, vi_complex inverse, vi_complex bessel[2])
{
    const double shrunk = exp(2.0 * z.re), c = cos(z.im), s = sin(z.im);
    const double turned = -2.0 * s * s; /* cos 2 im - 1 */
    const vi_complex less = {expm1(2.0 * z.re) + shrunk * turned, shrunk * (2.0 * s * c)};
    bessel[0] = vi_complex_scale(0.5, vi_complex_multiply(less, inverse));
    const vi_complex mean = {0.5 * less.re + 1.0, 0.5 * less.im};
    bessel[1] = vi_complex_multiply(vi_complex_subtract(mean, bessel[0]), inverse);
}

static void upwards(vi_complex inverse, vi_complex bessel[VI_NODES])
{
    for (int n = 1; n + 1 < VI_NODES; ++n) {
        const vi_complex step = vi_complex_scale((double)(2 * n + 1), vi_complex_multiply(inverse, bessel[n]));
        bessel[n + 1] = vi_complex_subtract(bessel[n - 1], step);
    }
}

/* Downwards from an order at which the function is negligible; the larger of the first two sets the scale. */
static void downwards(vi_complex inverse, double size, vi_complex bessel[VI_NODES])
{
    const vi_complex known[2] = {bessel[0], bessel[1]};
    vi_complex above = {0.0, 0.0}, now = {1e-50, 0.0};
    for (int n = VI_NODES + 8 + (int)(1.5 * size); n >= 0; --n) {
        if (n < VI_NODES) {
            bessel[n] = now;
        }
        const vi_complex step = vi_complex_scale((double)(2 * n + 1), vi_complex_multiply(inverse, now));
        const vi_complex below = vi_complex_add(above, step);
        above = now;
        now = below;
    }
    const int by = vi_complex_square(known[0]) >= vi_complex_square(known[1]) ? 0 : 1;
    const vi_complex scale = vi_complex_divide(known[by], bessel[by]);
    for (int n = 0; n < VI_NODES; ++n) {
        bessel[n] = vi_complex_multiply(scale, bessel[n]);
    }
}

/* e^z i_n(z), n = 0 to VI_NODES - 1, for Re z <= 0 and z other than 0. */
static void scaled_bessel(vi_complex z, vi_complex bessel[VI_NODES])
{
    const double size = vi_complex_size(z);
    if (size < SMALL) {
        const double shrunk = exp(z.re);
        by_powers(z, (vi_complex){shrunk * cos(z.im), shrunk * sin(z.im)}, bessel);
        return;
    }
    const vi_complex inverse = vi_complex_invert(z);
    first_two(z, inverse, bessel);
    if (size >= LARGEST || (size >= LARGE && -z.re <= LIGHT * size)) {
        upwards(inverse, bessel);
    } else {
        downwards(inverse, size, bessel);
    }
}

void vi_moments(const vi_mode *mode, double length, double displacement[VI_NODES], double velocity[VI_NODES])
{
    if (mode->natural == 0.0) {
        memset(displacement, 0, VI_NODES * sizeof displacement[0]);
        memset(velocity, 0, VI_NODES * sizeof velocity[0]);
        displacement[0] = 0.5 * length * length;
        displacement[1] = -displacement[0] / 3.0;
        velocity[0] = length;
        return;
    }
    const vi_complex lambda = {-mode->decay, mode->rate};
    vi_complex bessel[VI_NODES];
    scaled_bessel(vi_complex_scale(0.5 * length, lambda), bessel);
    double share = length / mode->rate;
    for (int n = 0; n < VI_NODES; ++n, share = -share) {
        displacement[n] = share * bessel[n].im;
        velocity[n] = share * (lambda.re * bessel[n].im + lambda.im * bessel[n].re);
    }
}
