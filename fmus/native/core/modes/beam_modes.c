#include "modes/beam_modes.h"

#include <float.h>
#include <math.h>

#include "sizes.h"

static const double PI = 3.14159265358979323846;
static const double PI_LOW = 1.22464679914735317636e-16;
static const double ROOT_2 = 1.41421356237309504880;
enum { NEWTON_STEPS = 12 }; /* most steps; six are enough */

/* An eigenvalue xi = turns pi + delta; `turns` is a multiple of 1/4, so turns * s is reduced without rounding. */
typedef struct {
    double turns, delta, xi;
} eigenvalue;

static double alternating(int j)
{
    return j % 2 == 0 ? 1.0 : -1.0;
}

static double turns_of(vi_beam_boundary boundary, int j)
{
    switch (boundary) {
    case VI_CLAMPED_FREE:
        return j - 0.5;
    case VI_CLAMPED_CLAMPED:
        return j + 0.5;
    case VI_CLAMPED_PINNED:
        return j + 0.25;
    default:
        return j;
    }
}

/* One Newton step on the equation for delta in equations.md 6.2, without cosh and sinh, which would overflow. */
static double newton_step(vi_beam_boundary boundary, int j, double xi, double delta)
{
    const double square = exp(-2.0 * xi);
    if (boundary == VI_CLAMPED_PINNED) {
        const double tangent = tan(delta);
        return (tangent + square) / (1.0 + tangent * tangent - 2.0 * square);
    }
    const double signed_sech = -alternating(j) * 2.0 * exp(-xi) / (1.0 + square);
    return (sin(delta) - signed_sech) / (cos(delta) + signed_sech * (1.0 - square) / (1.0 + square));
}

static eigenvalue find_eigenvalue(vi_beam_boundary boundary, int j)
{
    eigenvalue e = {.turns = turns_of(boundary, j), .delta = 0.0, .xi = 0.0};
    double change = boundary == VI_PINNED_PINNED ? 0.0 : 1.0;
    e.xi = fma(PI, e.turns, PI_LOW * e.turns);
    for (int step = 0; step < NEWTON_STEPS && fabs(change) > DBL_EPSILON * fabs(e.delta); ++step) {
        change = newton_step(boundary, j, e.xi, e.delta);
        e.delta -= change;
        e.xi = fma(PI, e.turns, fma(PI_LOW, e.turns, e.delta));
    }
    return e;
}

double vi_beam_eigenvalue(vi_beam_boundary boundary, int j)
{
    return find_eigenvalue(boundary, j).xi;
}

/* sin and cos of pi turns s + delta s. The first product is reduced to within pi/4 exactly: turns * s = high + low, and
 * whole quarters have no rounding. */
static void sine_cosine(double turns, double delta, double s, double *sine, double *cosine)
{
    const double high = turns * s, low = fma(turns, s, -high);
    const double quarters = rint(2.0 * high);
    const double rest = high - 0.5 * quarters;
    const double angle = PI * rest + fma(PI, low, delta * s);
    const double a = sin(angle), b = cos(angle);
    switch ((int)fmod(quarters, 4.0)) {
    case 0:
        *sine = a;
        *cosine = b;
        break;
    case 1:
        *sine = b;
        *cosine = -a;
        break;
    case 2:
        *sine = -a;
        *cosine = -b;
        break;
    default:
        *sine = -b;
        *cosine = a;
    }
}

/* Differentiate sin and -cos over their argument. */
static void differentiate(int derivative, double *sine, double *minus_cosine)
{
    for (int d = 0; d < derivative; ++d) {
        const double kept = *sine;
        *sine = -*minus_cosine;
        *minus_cosine = kept;
    }
}

/* Factor B of equations.md 6.3, of the wave that decays from the far end. */
static double far_wave(vi_beam_boundary boundary, int j, double xi)
{
    const double e = exp(-xi), square = e * e;
    const double sech = 2.0 * e / (1.0 + square);
    const double signed_tanh = alternating(j) * (1.0 - square) / (1.0 + square);
    switch (boundary) {
    case VI_CLAMPED_FREE:
        return 2.0 * (e - sech - signed_tanh) / (1.0 + square - 2.0 * e * sech);
    case VI_CLAMPED_CLAMPED:
        return 2.0 * (-e + sech - signed_tanh) / (1.0 - square - 2.0 * e * signed_tanh);
    default:
        return -2.0 * e / (1.0 - square);
    }
}

/* Shape of equations.md 6.3, ordered so that displacement and slope vanish exactly at the clamp. */
static double waves(vi_beam_boundary boundary, int j, double s, int derivative)
{
    const eigenvalue e = find_eigenvalue(boundary, j);
    const double b = far_wave(boundary, j, e.xi), end = exp(-e.xi);
    const double decaying = (derivative % 2 == 0 ? 1.0 : -1.0) * exp(-e.xi * s);
    const double growing = exp(-e.xi * (1.0 - s));
    double sine, cosine;
    sine_cosine(e.turns, e.delta, s, &sine, &cosine);
    double minus_cosine = -cosine;
    differentiate(derivative, &sine, &minus_cosine);
    const double near = (minus_cosine + decaying) + sine;
    const double far = 0.5 * b * growing - b * end * (sine + 0.5 * decaying);
    return near + far;
}

static double power(double x, int exponent)
{
    double product = 1.0;
    for (int i = 0; i < exponent; ++i) {
        product *= x;
    }
    return product;
}

static double pinned_shape(int j, double s, int derivative)
{
    double sine, cosine;
    sine_cosine(j, 0.0, s, &sine, &cosine);
    double minus_cosine = -cosine;
    differentiate(derivative, &sine, &minus_cosine);
    return ROOT_2 * power(vi_beam_eigenvalue(VI_PINNED_PINNED, j), derivative) * sine;
}

/* Does the far end prescribe that this derivative is 0? */
static int vanishes_at_end(vi_beam_boundary boundary, int derivative)
{
    return boundary == VI_CLAMPED_FREE ? derivative >= 2 : derivative == 0 || derivative == 2;
}

double vi_beam_shape(vi_beam_boundary boundary, int j, double s, int derivative)
{
    if (boundary == VI_PINNED_PINNED) {
        return pinned_shape(j, s, derivative);
    }
    double sign = 1.0;
    if (boundary == VI_CLAMPED_CLAMPED) {
        if (s > 0.5) { /* both ends are alike */
            s = 1.0 - s;
            sign = -alternating(j + derivative);
        }
    } else if (s == 1.0 && vanishes_at_end(boundary, derivative)) {
        return 0.0;
    } else if (s == 1.0 && boundary == VI_CLAMPED_FREE && derivative == 0) {
        return -2.0 * alternating(j);
    }
    return sign * power(vi_beam_eigenvalue(boundary, j), derivative) * waves(boundary, j, s, derivative);
}

/* equations.md 6.5: difference of phi''' / xi^4 between the ends, with phi'''(0) = -2 sig xi^3. */
double vi_beam_participation(vi_beam_boundary boundary, int j)
{
    if (boundary == VI_PINNED_PINNED) {
        return j % 2 == 0 ? 0.0 : 2.0 * ROOT_2 / vi_beam_eigenvalue(boundary, j);
    }
    const double xi = vi_beam_eigenvalue(boundary, j);
    const double sig = 1.0 - far_wave(boundary, j, xi) * exp(-xi);
    switch (boundary) {
    case VI_CLAMPED_FREE:
        return 2.0 * sig / xi;
    case VI_CLAMPED_CLAMPED:
        return j % 2 == 0 ? 0.0 : 4.0 * sig / xi;
    default:
        return (waves(boundary, j, 1.0, 3) + 2.0 * sig) / xi;
    }
}

double vi_beam_validity(vi_beam_boundary boundary, int j, double slenderness, double e_over_g, double shear_coefficient)
{
    const double ratio = vi_beam_eigenvalue(boundary, j) * slenderness;
    return 0.5 * ratio * ratio * (1.0 + e_over_g / shear_coefficient);
}

/* Gaussian elimination with partial pivoting on rows a[k][0..n], right-hand side last; 0: singular to rounding. */
static int solve(int n, double a[][VI_MODES + 1], double x[])
{
    for (int step = 0; step < n; ++step) {
        int best = step;
        for (int i = step + 1; i < n; ++i) {
            best = fabs(a[i][step]) > fabs(a[best][step]) ? i : best;
        }
        for (int j = step; j <= n; ++j) {
            const double kept = a[step][j];
            a[step][j] = a[best][j];
            a[best][j] = kept;
        }
        if (!(fabs(a[step][step]) > 8.0 * n * DBL_EPSILON)) { /* shapes are of order 1 */
            return 0;
        }
        for (int i = step + 1; i < n; ++i) {
            const double factor = a[i][step] / a[step][step];
            for (int j = step + 1; j <= n; ++j) {
                a[i][j] -= factor * a[step][j];
            }
        }
    }
    for (int i = n - 1; i >= 0; --i) {
        x[i] = a[i][n];
        for (int j = i + 1; j < n; ++j) {
            x[i] -= a[i][j] * x[j];
        }
        x[i] /= a[i][i];
    }
    return 1;
}

int vi_beam_collocation(vi_beam_boundary boundary, int n, const double s[], int at, double direction[])
{
    if (n < 1 || n > VI_MODES || at < 0 || at >= n) {
        return 0;
    }
    double a[VI_MODES][VI_MODES + 1];
    for (int k = 0; k < n; ++k) {
        for (int j = 0; j < n; ++j) {
            a[k][j] = vi_beam_shape(boundary, j + 1, s[k], 0);
        }
        a[k][n] = k == at ? 1.0 : 0.0;
    }
    return solve(n, a, direction);
}
