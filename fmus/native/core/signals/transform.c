#include "signals/transform.h"

#include "motion/rows.h"

static const double PI = 3.141592653589793116;

/* ---- cosines ---- */

/* Factors of the powers of -x^2 in cos(x) and sin(x) / x; up to pi / 4 the next ones are below 1e-18. */
enum { TERMS = 9 };
static const double OF_COSINE[TERMS] = {1.0, 1.0 / 2.0, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40320.0, 1.0 / 3628800.0,
                                        1.0 / 479001600.0, 1.0 / 87178291200.0, 1.0 / 20922789888000.0};
static const double OF_SINE[TERMS] = {1.0, 1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362880.0, 1.0 / 39916800.0,
                                      1.0 / 6227020800.0, 1.0 / 1307674368000.0, 1.0 / 355687428096000.0};

/* Cosine and sine of pi part, part <= 1/4, by their Taylor series. */
static void eighth_turn(double part, double *cosine, double *sine)
{
    const double angle = PI * part, square = -(angle * angle);
    double c = OF_COSINE[TERMS - 1], s = OF_SINE[TERMS - 1];
    for (int n = TERMS - 2; n >= 0; --n) {
        c = c * square + OF_COSINE[n];
        s = s * square + OF_SINE[n];
    }
    *cosine = c;
    *sine = s * angle;
}

/* The same for part < 1. */
static void half_turn(double part, double *cosine, double *sine)
{
    const double mirrored = part > 0.5 ? 1.0 - part : part;
    if (mirrored > 0.25) {
        eighth_turn(0.5 - mirrored, sine, cosine);
    } else {
        eighth_turn(mirrored, cosine, sine);
    }
    *cosine = part > 0.5 ? -*cosine : *cosine;
}

void vi_transform_prepare(vi_transform *transform, int size)
{
    for (int half = 1; half < size && size > transform->size; half *= 2) {
        double *const cosine = transform->cosine + half, *const sine = transform->sine + half;
        for (int j = 0; j < half; ++j) {
            if (j % 2 == 1 || half == 1) {
                half_turn((double)j / (double)half, &cosine[j], &sine[j]);
            } else { /* known from the half length before */
                cosine[j] = transform->cosine[(half + j) / 2];
                sine[j] = transform->sine[(half + j) / 2];
            }
        }
    }
    transform->size = size > transform->size ? size : transform->size;
}

int vi_transform_place(int size, int j)
{
    int place = 0;
    for (int bit = 1; bit < size; bit *= 2) {
        place = 2 * place + (j & 1);
        j >>= 1;
    }
    return place;
}

/* ---- two stages at once ----
 *
 * Four numbers that are `quarter` places apart pass a stage of half length 2 quarter, then one of half length quarter.
 * first, second: factors exp(-i pi j / (2 quarter)) and exp(-i pi j / quarter). */

typedef struct {
    vi_pair real, imaginary;
} pair;

static inline pair load(const double real[], const double imaginary[])
{
    return (pair){*(const vi_pair *)real, *(const vi_pair *)imaginary};
}

static inline void store(pair z, double real[], double imaginary[])
{
    *(vi_pair *)real = z.real;
    *(vi_pair *)imaginary = z.imaginary;
}

static inline pair sum(pair a, pair b)
{
    return (pair){a.real + b.real, a.imaginary + b.imaginary};
}

static inline pair difference(pair a, pair b)
{
    return (pair){a.real - b.real, a.imaginary - b.imaginary};
}

/* z times i */
static inline pair turned(pair z)
{
    return (pair){-z.imaginary, z.real};
}

/* z (c - i s), and z (c + i s), for factors c + i s */
static inline pair turned_back_by(pair z, pair factor)
{
    return (pair){z.real * factor.real + z.imaginary * factor.imaginary,
                  z.imaginary * factor.real - z.real * factor.imaginary};
}

static inline pair turned_by(pair z, pair factor)
{
    return (pair){z.real * factor.real - z.imaginary * factor.imaginary,
                  z.imaginary * factor.real + z.real * factor.imaginary};
}

static void forward_stages(const vi_transform *t, int quarter, double *real, double *imaginary)
{
    const int half = 2 * quarter;
    for (int j = 0; j < quarter; j += VI_LANES) {
        double *const x = real + j, *const y = imaginary + j;
        const pair a = load(x, y), b = load(x + quarter, y + quarter), c = load(x + half, y + half);
        const pair d = load(x + half + quarter, y + half + quarter);
        const pair first = load(t->cosine + half + j, t->sine + half + j);
        const pair second = load(t->cosine + quarter + j, t->sine + quarter + j);
        const pair even = sum(a, c), odd = sum(b, d), p = difference(a, c), q = turned(difference(b, d));
        store(sum(even, odd), x, y);
        store(turned_back_by(difference(even, odd), second), x + quarter, y + quarter);
        store(turned_back_by(difference(p, q), first), x + half, y + half);
        store(turned_back_by(turned_back_by(sum(p, q), first), second), x + half + quarter, y + half + quarter);
    }
}

static void backward_stages(const vi_transform *t, int quarter, double *real, double *imaginary)
{
    const int half = 2 * quarter;
    for (int j = 0; j < quarter; j += VI_LANES) {
        double *const x = real + j, *const y = imaginary + j;
        const pair first = load(t->cosine + half + j, t->sine + half + j);
        const pair second = load(t->cosine + quarter + j, t->sine + quarter + j);
        const pair a = load(x, y), b = turned_by(load(x + quarter, y + quarter), second);
        const pair c = turned_by(load(x + half, y + half), first);
        const pair d = turned_by(turned_by(load(x + half + quarter, y + half + quarter), second), first);
        const pair even = sum(a, b), odd = difference(a, b), p = sum(c, d), q = turned(difference(c, d));
        store(sum(even, p), x, y);
        store(sum(odd, q), x + quarter, y + quarter);
        store(difference(even, p), x + half, y + half);
        store(difference(odd, q), x + half + quarter, y + half + quarter);
    }
}

/* The stage of half length 1, or those of 2 and 1, of all numbers. */
static void last_stage(int size, double *real, double *imaginary)
{
    for (int k = 0; k < size; k += 2) {
        const double x = real[k], y = imaginary[k];
        real[k] = x + real[k + 1];
        real[k + 1] = x - real[k + 1];
        imaginary[k] = y + imaginary[k + 1];
        imaginary[k + 1] = y - imaginary[k + 1];
    }
}

/* sign: -1 forward, 1 backward. Forward the half length 2 comes first, backward it comes last. */
static void last_two_stages(int size, double sign, double *real, double *imaginary)
{
    for (int k = 0; k < size; k += 4) {
        double *const x = real + k, *const y = imaginary + k;
        const int near = sign < 0.0 ? 2 : 1, far = 3 - near;
        const double even = x[0] + x[near], odd = x[far] + x[3], p = x[0] - x[near], q = x[far] - x[3];
        const double even_y = y[0] + y[near], odd_y = y[far] + y[3], p_y = y[0] - y[near], q_y = y[far] - y[3];
        x[0] = even + odd;
        y[0] = even_y + odd_y;
        x[far] = even - odd;
        y[far] = even_y - odd_y;
        x[near] = p - sign * q_y;
        y[near] = p_y + sign * q;
        x[3] = p + sign * q_y;
        y[3] = p_y - sign * q;
    }
}

/* A stage of half length 2 alone never happens: pairs of stages end at 1 or at 2. */
void vi_transform_forward(const vi_transform *transform, int size, double real[], double imaginary[])
{
    int quarter = size / 4;
    for (; quarter >= VI_LANES; quarter /= 4) {
        for (int k = 0; k < size; k += 4 * quarter) {
            forward_stages(transform, quarter, real + k, imaginary + k);
        }
    }
    if (quarter == 1) {
        last_two_stages(size, -1.0, real, imaginary);
    } else {
        last_stage(size, real, imaginary);
    }
}

void vi_transform_backward(const vi_transform *transform, int size, double real[], double imaginary[])
{
    int quarter = 4;
    for (int left = size; left > 1; left /= 4) {
        quarter = left == 2 ? 2 : quarter;
    }
    if (quarter == 4) {
        last_two_stages(size, 1.0, real, imaginary);
    } else {
        last_stage(size, real, imaginary);
    }
    for (; 4 * quarter <= size; quarter *= 4) {
        for (int k = 0; k < size; k += 4 * quarter) {
            backward_stages(transform, quarter, real + k, imaginary + k);
        }
    }
}
